//! Definitions of the numbers of the document.

/// Definitions of the numbers, for readers of the file.
pub(super) const DEFINITIONS: [(&str, &str); 17] = [
    (
        "before, after",
        "results with the orientation from the kernels (before) and with the adjusted orientation (after), for which \
         ground points are intersected again",
    ),
    (
        "focal",
        "focal-plane residual of the intersection, along and across the track, image pixels",
    ),
    (
        "reprojection",
        "measured minus projected position of the intersected point: lines along the track, image pixels \
         across the track; also for the residuals of pairs (Table 5 of Shan et al. 2005)",
    ),
    (
        "heights",
        "heights of tie points above the {altimeter} surface, metres: before the adjustment, a test of the \
         orientation; after the adjustment, the fit of the points to their control",
    ),
    (
        "along_track_parallax_m",
        "absolute value of the mean displacement along the flight between the positions of tie points according to \
         the two images, metres",
    ),
    (
        "along_track",
        "this displacement with its sign, first minus second image, and its changes: with a rotation of each camera \
         (range_m, metres per radian), with the line times of each image (line_time_m_s, metres per second), and with \
         one offset of the attitude clock of both images (clock_m_s, metres per second); input of areograph \
         compare-readings. Absent where the images were not flown in the same direction, or are not apart across the \
         track",
    ),
    (
        "footprints",
        "position of a footprint in the second image, transferred from the first by the tie points, minus its projected \
         position: in lines and samples of the second image, in metres on the ground, and in shot spacings. Only \
         footprints that both images show on lines between those of the tie points are counted; outside is the number \
         of footprints within the lines of both images that one image does not show. above_mola_m: heights at which \
         the rays of these positions meet, minus the heights of the footprints",
    ),
    (
        "budget",
        "eq. 5 to 9 of Shan et al. 2005; a pixel is the mean line spacing of the pair. paper_average takes the average of \
         the images' across-track residuals, as Shan et al. compute it; equation_7 takes their sum of squares, as eq. 7 \
         states. Both add the means of the images in quadrature. equation_5 contains the differences between the images \
         at each tie point, in which means of opposite sign add up, and the mean misregistration that these differences \
         leave unexplained",
    ),
    (
        "correction, sigmas",
        "X, Y and Z position in {frame}, metres, then rotations about the camera's x, y and z axes, radians: the \
         coefficients of 1, t and t² of each, with t = 0 in the middle of the image and t = 1 at its end. \
         M = exp([rotation]x) M before",
    ),
    (
        "sigmas",
        "standard deviations from covariances that follow from a priori variances and are multiplied by the variance \
         factor. The published model treats image coordinates of footprints, which are not independent, as \
         independent measurements: its standard deviations describe the agreement of the images, not the accuracy of \
         heights and positions",
    ),
    (
        "sigmas of images",
        "standard deviations of the camera pose at the exposure of a line. Position, pitch and line times are not \
         separated along the track: the position at the tag of a line may differ from the position at its exposure by \
         the distance flown in line_time_sigma_s, and the rotation compensates for this on the ground. Use position \
         and rotation together. The standard deviations do not contain the uncertainty of a time bias (time_bias_s)",
    ),
    (
        "sigmas_m of shots",
        "standard deviations including the uncertainty of the profile's shift (laser_surface.profile_plan_sigma_m, \
         profile_sigma_m; adjusted values where spots determine the shift). All footprints of a profile share this \
         shift, which does not average out. adjusted_footprints.parquet contains both parts",
    ),
    (
        "mean_sigma_m",
        "standard deviation of the error that all tie points share; standard deviations of single points contain this \
         error. The standard deviations without the shared error are relative_sigma_east_m, \
         relative_sigma_north_m and relative_sigma_up_m of ties.parquet",
    ),
    (
        "mean_sigma_parts",
        "mean_sigma_m by cause; squares of the parts add up to its squares. frame_m and boresight_m are errors that other sites have as \
         well; profiles_m is shared by sites with the same profiles; all other parts belong to this site alone, except that an offset of \
         the attitude clock in orientations_m is common to a mission phase. The common shift of profiles (frame_m) is not modelled for \
         profiles with laser spots (adjustment.common_bus). Single tie points have further errors (relative_sigma_* of ties.parquet)",
    ),
    (
        "other_reading",
        "where a pair disagrees by more than 100 m along the flight: the mean position of the tie points in the other \
         of two readings (all images equally likely to be in error, or one offset of the attitude clock, \
         attitude_clock_s), minus their mean position in the adjustment. No measurement decides between the readings: \
         each standard deviation applies to its own reading",
    ),
    (
        "boresight",
        "where adjustment.common_bus is yes: angles of the laser from the direction that the mounting and the altimeter file \
         give (towards X of the bus, and perpendicular to X and the beam), their a priori values (prior), what the observations of this site \
         state without these (information: the input of areograph estimate-boresight), the offset of each recorded profile from its \
         adjusted position, and the unknown with the largest standardised residual of its a priori value",
    ),
    (
        "configured",
        "a standard deviation above 1e300 leaves the unknown free; without blunder_limit and height_blunder_limit, all tie \
         points are kept",
    ),
];
