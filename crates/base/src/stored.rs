//! Fields that a document omits if they have no value.
//!
//! Outputs of stages are stored without field names, so that every field must be present. A field with
//! `#[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]` has no key in a JSON document without a
//! value, and is written by [`whole`].

use std::cell::Cell;

thread_local! {
    static WHOLE: Cell<bool> = const { Cell::new(false) };
}

/// Whether a field is omitted: in a document, if it has no value.
#[must_use]
pub fn is_left_out<T>(value: &Option<T>) -> bool {
    value.is_none() && !WHOLE.get()
}

/// Whether a list is omitted: it has no value if it is empty.
#[must_use]
pub fn is_list_left_out<T>(list: &[T]) -> bool {
    list.is_empty() && !WHOLE.get()
}

/// Result of `write` with all fields serialized, on this thread.
pub fn whole<T>(write: impl FnOnce() -> T) -> T {
    struct Reset(bool);
    impl Drop for Reset {
        fn drop(&mut self) {
            WHOLE.set(self.0);
        }
    }
    let _reset = Reset(WHOLE.replace(true));
    write()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_without_a_value_is_left_out_of_documents_alone() {
        assert!(is_left_out::<f64>(&None) && !is_left_out(&Some(1.0)));
        assert!(whole(|| !is_left_out::<f64>(&None)));
        assert!(is_list_left_out::<f64>(&[]) && !is_list_left_out(&[1.0]));
        assert!(whole(|| !is_list_left_out::<f64>(&[])));
        assert!(is_left_out::<f64>(&None));
    }
}
