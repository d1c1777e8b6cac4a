//! Tables and scans as bytes between the program that asks, the scheduler and the executors.

use std::{fmt, sync::Arc};

use areograph_sql::{
    Columns,
    datafusion::{
        arrow::datatypes::SchemaRef,
        catalog::TableProvider,
        common::{DataFusionError, Result as Answer, TableReference, exec_err},
        execution::TaskContext,
        logical_expr::{Expr, Extension, LogicalPlan},
        physical_plan::ExecutionPlan,
    },
};
use ballista_core::serde::{BallistaLogicalExtensionCodec, BallistaPhysicalExtensionCodec};
use datafusion_proto::{
    bytes::Serializeable as _,
    logical_plan::LogicalExtensionCodec,
    physical_plan::{PhysicalExtensionCodec, PhysicalProtoConverterExtension},
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{
    scan::{Reading, ShotsScan},
    table::ArchiveTable,
};

/// Start of a scan and of a table: nodes of Ballista itself are in protobuf, which never begins with this byte.
const MARK: &[u8] = b"\0areograph ";
/// Version of the program, which decides on the meaning of the columns.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A scan in its encoded form.
#[derive(Serialize, Deserialize)]
struct Stored {
    projection: Option<Vec<usize>>,
    /// Conditions in protobuf.
    filters: Vec<Vec<u8>>,
    limit: Option<usize>,
}

/// The codec of tables and scans; everything else is encoded by Ballista.
#[derive(Clone)]
pub(super) struct Codec {
    columns: Arc<dyn Columns>,
}

impl fmt::Debug for Codec {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Codec")
    }
}

impl Codec {
    pub(super) fn new(columns: Arc<dyn Columns>) -> Self {
        Self { columns }
    }
}

fn encode(value: &impl Serialize, bytes: &mut Vec<u8>) -> Answer<()> {
    let value = postcard::to_stdvec(&(VERSION, value));
    let value = value.map_err(|error| DataFusionError::External(Box::new(error)))?;
    bytes.extend(MARK);
    bytes.extend(value);
    Ok(())
}

/// The value in bytes of this program, `None` in those of another.
fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Answer<Option<T>> {
    let Some(rest) = bytes.strip_prefix(MARK) else {
        return Ok(None);
    };
    // The version comes first: another one may have another form.
    let version: Result<(&str, &[u8]), _> = postcard::take_from_bytes(rest);
    match version {
        Ok((VERSION, rest)) => match postcard::from_bytes(rest) {
            Ok(value) => Ok(Some(value)),
            Err(error) => exec_err!("a plan of areograph {VERSION} is damaged: {error}"),
        },
        Ok((version, _)) => exec_err!(
            "the query comes from areograph {version}, but this process is areograph {VERSION}: use one version for all"
        ),
        Err(error) => exec_err!("a plan of areograph is damaged: {error}"),
    }
}

impl LogicalExtensionCodec for Codec {
    fn try_decode(
        &self,
        bytes: &[u8],
        inputs: &[LogicalPlan],
        context: &TaskContext,
    ) -> Answer<Extension> {
        BallistaLogicalExtensionCodec::default().try_decode(bytes, inputs, context)
    }

    fn try_encode(&self, node: &Extension, bytes: &mut Vec<u8>) -> Answer<()> {
        BallistaLogicalExtensionCodec::default().try_encode(node, bytes)
    }

    fn try_decode_table_provider(
        &self,
        bytes: &[u8],
        table: &TableReference,
        schema: SchemaRef,
        context: &TaskContext,
    ) -> Answer<Arc<dyn TableProvider>> {
        let Some(groups) = decode(bytes)? else {
            let others = BallistaLogicalExtensionCodec::default();
            return others.try_decode_table_provider(bytes, table, schema, context);
        };
        let archive = ArchiveTable::of_groups(groups, Arc::clone(&self.columns));
        if archive.schema() != schema {
            return exec_err!(
                "the query comes from a build of areograph with other columns: use one build for all processes"
            );
        }
        Ok(Arc::new(archive))
    }

    fn try_encode_table_provider(
        &self,
        table: &TableReference,
        node: Arc<dyn TableProvider>,
        bytes: &mut Vec<u8>,
    ) -> Answer<()> {
        match node.downcast_ref::<ArchiveTable>() {
            Some(archive) => encode(&archive.groups(), bytes),
            None => BallistaLogicalExtensionCodec::default()
                .try_encode_table_provider(table, node, bytes),
        }
    }
}

impl PhysicalExtensionCodec for Codec {
    fn try_decode(
        &self,
        bytes: &[u8],
        inputs: &[Arc<dyn ExecutionPlan>],
        context: &TaskContext,
        converter: &dyn PhysicalProtoConverterExtension,
    ) -> Answer<Arc<dyn ExecutionPlan>> {
        let Some(stored) = decode::<Stored>(bytes)? else {
            let others = BallistaPhysicalExtensionCodec::default();
            return others.try_decode(bytes, inputs, context, converter);
        };
        let filters = stored.filters.iter();
        let filters = filters.map(|bytes| Expr::from_bytes_with_ctx(bytes, context));
        let reading = Reading {
            projection: stored.projection,
            filters: filters.collect::<Answer<_>>()?,
            limit: stored.limit,
        };
        let [files] = inputs else {
            return exec_err!("a scan of areograph has one input");
        };
        let columns = Arc::clone(&self.columns);
        Ok(Arc::new(ShotsScan::new(
            Arc::clone(files),
            reading,
            columns,
        )))
    }

    fn try_encode(
        &self,
        node: Arc<dyn ExecutionPlan>,
        bytes: &mut Vec<u8>,
        converter: &dyn PhysicalProtoConverterExtension,
    ) -> Answer<()> {
        let Some(shots) = node.downcast_ref::<ShotsScan>() else {
            return BallistaPhysicalExtensionCodec::default().try_encode(node, bytes, converter);
        };
        let reading = shots.reading();
        let filters = reading.filters.iter();
        let filters = filters.map(|filter| Ok(filter.to_bytes()?.to_vec()));
        let stored = Stored {
            projection: reading.projection.clone(),
            filters: filters.collect::<Answer<_>>()?,
            limit: reading.limit,
        };
        encode(&stored, bytes)
    }
}
