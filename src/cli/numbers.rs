//! Range checks for numbers on the command line, as for numbers of a site file.

/// Reads a number above `low`, up to `high`.
pub(super) fn above_to(
    low: f64,
    high: f64,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = text.trim().parse().ok();
        let fits = |number: &f64| *number > low && *number <= high;
        number
            .filter(fits)
            .ok_or_else(|| format!("expected a number above {low}, up to {high}"))
    }
}
