//! Columns between Rust and Python: Arrow's stream interface outwards, buffers of numbers inwards.

use arrow_array::{
    ArrayRef, Float64Array, RecordBatch, RecordBatchIterator, ffi_stream::FFI_ArrowArrayStream,
};
use arrow_schema::SchemaRef;
use pyo3::{buffer::PyBuffer, exceptions::PyValueError, prelude::*, types::PyCapsule};

/// A table that Arrow libraries take over without a copy (`__arrow_c_stream__` of the `PyCapsule` interface).
#[pyclass(frozen, module = "areograph._native")]
pub(crate) struct Columns {
    schema: SchemaRef,
    batches: Vec<RecordBatch>,
}

impl Columns {
    pub(crate) const fn new(schema: SchemaRef, batches: Vec<RecordBatch>) -> Self {
        Self { schema, batches }
    }

    /// Columns of equal length.
    ///
    /// # Errors
    /// Columns of different lengths.
    pub(crate) fn of<'a>(columns: impl IntoIterator<Item = (&'a str, ArrayRef)>) -> PyResult<Self> {
        let batch = RecordBatch::try_from_iter(columns);
        let batch = batch.map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(Self::new(batch.schema(), vec![batch]))
    }
}

#[pymethods]
impl Columns {
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The interface allows a producer to ignore the schema: the consumer then converts.
        drop(requested_schema);
        let batches = self.batches.clone().into_iter().map(Ok);
        let rows = RecordBatchIterator::new(batches, SchemaRef::clone(&self.schema));
        let stream = FFI_ArrowArrayStream::new(Box::new(rows));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }
}

/// A column of numbers.
pub(crate) fn numbers(values: Vec<f64>) -> ArrayRef {
    std::sync::Arc::new(Float64Array::from(values))
}

/// Numbers of one-dimensional arrays of equal length.
///
/// # Errors
/// Other types and shapes; arrays of different lengths.
pub(crate) fn arrays<const N: usize>(
    py: Python<'_>,
    names: [&str; N],
    arrays: [&Bound<'_, PyAny>; N],
) -> PyResult<[Vec<f64>; N]> {
    let mut read: [Vec<f64>; N] = std::array::from_fn(|_| Vec::new());
    for ((name, array), read) in names.iter().zip(arrays).zip(&mut read) {
        let buffer = PyBuffer::<f64>::get(array).ok();
        let buffer = buffer.filter(|buffer| buffer.dimensions() == 1);
        let Some(buffer) = buffer else {
            return Err(PyValueError::new_err(format!(
                "{name}: expected a one-dimensional array of float64"
            )));
        };
        *read = buffer.to_vec(py)?;
    }
    let lengths = read.each_ref().map(Vec::len);
    if lengths.iter().any(|length| *length != lengths[0]) {
        let lengths = names.iter().zip(lengths);
        let lengths: Vec<String> = lengths
            .map(|(name, length)| format!("{name} {length}"))
            .collect();
        return Err(PyValueError::new_err(format!(
            "arrays of different lengths: {}",
            lengths.join(", ")
        )));
    }
    Ok(read)
}
