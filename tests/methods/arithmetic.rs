//! What this machine computes where its library, its processor or its compiler of C may choose.

use nalgebra::DMatrix;

/// Arguments of every function.
const ARGUMENTS: u32 = 2_000;
/// Edge of the matrices that are multiplied: enough for kernels of wide registers.
const EDGE: usize = 48;

/// BLAKE3 over results of the mathematical library and of a product of matrices, whose kernel is chosen by the processor; and
/// over the name of the architecture, since compilers of C contract products and sums on some.
pub(crate) fn fingerprint() -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(std::env::consts::ARCH.as_bytes());
    for step in 0..ARGUMENTS {
        // Opaque, so that no compiler computes them with a library of its own.
        let x = std::hint::black_box(0.003 * f64::from(step) + 1e-3);
        let y = std::hint::black_box(1.0 / x - 0.7);
        let results = [
            x.sin(),
            (100.0 * x).cos(),
            x.tan(),
            y.atan2(x - 2.0),
            (y / (1.0 + y.abs())).asin(),
            (-x).exp(),
            x.ln(),
            x.powf(y.clamp(-3.0, 3.0)),
            x.hypot(y),
            x.cbrt(),
            y.sinh(),
        ];
        for result in results {
            hasher.update(&result.to_bits().to_le_bytes());
        }
    }
    let entry = |row: usize, column: usize| ((row * 31 + column * 17) as f64).sin();
    let matrix = DMatrix::from_fn(EDGE, EDGE, entry);
    for number in (&matrix * matrix.transpose()).iter() {
        hasher.update(&number.to_bits().to_le_bytes());
    }
    hasher.finalize().to_hex().to_string()
}
