//! Boxes on the command line.

/// West, east, south and north edge, as they are written.
pub(super) fn edges(text: &str) -> std::result::Result<[f64; 4], String> {
    let numbers: std::result::Result<Vec<f64>, _> = text
        .split(',')
        .map(|number| number.trim().parse())
        .collect();
    let numbers = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    numbers.ok_or_else(|| "expected four numbers: west,east,south,north".to_owned())
}
