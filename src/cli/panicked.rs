//! A task that panicked, as a failure.

use tokio::task::JoinError;

use crate::{
    column::lost_values,
    error::{Cause, Result},
};

#[derive(Debug, thiserror::Error, Cause)]
#[error("internal error of areograph: {0}")]
#[cause(Bug: "please report it with the configuration; the next run detects and repairs incomplete products")]
struct Panicked(String);

/// The result of a task. One that panicked is a bug in areograph, reported like any other failure, unless it ended since
/// values of a column were lost.
pub(super) fn flatten<T>(joined: std::result::Result<Result<T>, JoinError>) -> Result<T> {
    joined.unwrap_or_else(|error| {
        let text = error.to_string();
        let panic = error.try_into_panic().ok();
        let lost = panic.and_then(|panic| lost_values(&*panic));
        Err(lost.unwrap_or_else(|| Panicked(text).into()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;

    #[test]
    fn a_panic_is_a_bug_and_a_result_is_passed_on() {
        let runtime = tokio::runtime::Runtime::new().unwrap();
        let join = |panics: bool| {
            let task = runtime.spawn(async move {
                assert!(!panics, "no such column");
                Ok::<_, crate::error::Error>(7)
            });
            flatten(runtime.block_on(task))
        };
        assert_eq!(join(false).unwrap(), 7);
        let failure = join(true).unwrap_err();
        assert_eq!(failure.kind(), Kind::Bug);
        assert!(failure.to_string().contains("internal error of areograph"));
    }
}
