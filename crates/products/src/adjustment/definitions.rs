//! Definitions of the numbers of the document.

/// Definitions of the numbers, for readers of the file.
pub(super) const DEFINITIONS: [(&str, &str); 15] = [
    (
        "before, after",
        "with the orientation from the kernels, and with the adjusted one; ground points are intersected again",
    ),
    (
        "focal",
        "residual of the intersection in the focal plane, along and across the track, pixels of the image",
    ),
    (
        "reprojection",
        "measured minus projected place of the intersected point: lines along the track, pixels of the image \
         across it; residuals of the pairs too (Table 5 of Shan et al. 2005)",
    ),
    (
        "heights",
        "tie points above the {altimeter} surface, metres: before the adjustment a test of the orientation, after it the fit of the \
         adjustment to its control",
    ),
    (
        "along_track_parallax_m",
        "mean distance along the flight between the two images' positions of a tie point, metres",
    ),
    (
        "footprints",
        "position of a footprint of the first image in the second by the tie points, minus its projected position: lines \
         and samples of the second image, metres on the ground, and distances of successive footprints. Only footprints \
         count that both images show, on a line between the lines of the tie points; outside are the footprints within the \
         lines of both images that lie outside one of them. above_mola_m: heights at which the rays of these places meet, \
         minus the heights of the footprints",
    ),
    (
        "budget",
        "eq. 5 to 9 of Shan et al. 2005; pixels are the mean line spacing of the pair. paper_average takes the average of \
         the images' across-track residuals as the paper computes it, equation_7 their sum of squares as its eq. 7 states; \
         both add the means of the images in quadrature. equation_5 has the differences of the images tie point by tie \
         point, where means of opposite sign add up, and the mean misregistration that they leave unexplained",
    ),
    (
        "correction, sigmas",
        "X, Y and Z position in {frame}, metres, then rotations about the camera's x, y and z axis, radians; of each \
         the coefficients of 1, t and t², t = 0 in the middle of the image and 1 at its end. M = exp([rotation]x) M before",
    ),
    (
        "sigmas",
        "a priori variances times the variance factor. The published model treats image coordinates of footprints as \
         independent measurements, which they are not: its standard deviations describe the agreement of the images, \
         not the accuracy of heights and positions",
    ),
    (
        "sigmas of images",
        "of the camera at the exposure of a line. Position, pitch and line times are not separated along the track: the \
         position at a line's tag may differ from the position at its exposure by the distance flown in line_time_sigma_s, \
         and the rotation compensates for this on the ground. Use position and rotation together. A time bias \
         (time_bias_s) is not contained",
    ),
    (
        "sigmas_m of shots",
        "with the shift of their profile (laser_surface.profile_plan_sigma_m, profile_sigma_m; where spots determine it, as adjusted), \
         which all footprints of a profile share: it does not average out. adjusted_footprints.parquet has both parts",
    ),
    (
        "mean_sigma_m",
        "of the error that all tie points share; standard deviations of single points contain it. The standard \
         deviations without it are relative_sigma_east_m, relative_sigma_north_m and relative_sigma_up_m of ties.parquet",
    ),
    (
        "other_reading",
        "where a pair disagrees by more than 100 m along the flight: the mean of the tie points by the other of two \
         readings (all images equally likely to be in error, or one offset of the attitude clock, attitude_clock_s), \
         minus the mean in the adjustment. No measurement decides between them: standard deviations hold for their own \
         reading",
    ),
    (
        "boresight",
        "where adjustment.common_bus is yes: angles of the laser from the direction that mounting and altimeter file give \
         (towards X of the bus, and at right angles to that and the beam), the offset of each recorded profile from its \
         adjusted position, and the unknown farthest from its a priori value, in standard deviations of the contradiction",
    ),
    (
        "configured",
        "a standard deviation above 1e300 leaves the unknown free; without blunder_limit and height_blunder_limit all tie \
         points are kept",
    ),
];
