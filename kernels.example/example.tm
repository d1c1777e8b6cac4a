KPL/MK

The text kernels of this folder; paths count from the folder of this file.
Binary kernels to go with them are written by `areograph scene`.

\begindata

KERNELS_TO_LOAD = ( 'leapseconds.tls'
                    'mgs_clock.tsc'
                    'mars_iau2000.tpc'
                    'moc.ti' )

\begintext
