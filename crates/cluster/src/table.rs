//! The table of shots as the program that asks and the scheduler know it: names and hashes of files, none of them open.

use std::{path, sync::Arc};

use areograph_base::error::{Cause, Error, IoError, Locate as _, Result};
use areograph_pds::archive::{Source, apart};
use areograph_sql::{
    Columns, ShotsTable,
    datafusion::{
        arrow::datatypes::SchemaRef,
        catalog::{Session, TableProvider},
        common::Result as Answer,
        logical_expr::{Expr, TableProviderFilterPushDown, TableType},
        physical_plan::ExecutionPlan,
    },
};
use async_trait::async_trait;

use super::{
    named::Named,
    scan::{Reading, ShotsScan},
};

/// Groups of files, each of which is the work of one executor at a time: enough to occupy a few computers, and few
/// enough that an answer does not wait for their exchange.
pub(super) const GROUPS_MAX: usize = 16;

/// A file of which the hash is not known.
#[derive(Debug, thiserror::Error, Cause)]
#[error("has no entry in an index, with which executors verify the file")]
#[cause(Input: "run `areograph pedr index` for the archive on this computer")]
pub struct NotIndexed;

/// A path that is not Unicode.
#[derive(Debug, thiserror::Error, Cause)]
#[error("has a path that is not Unicode, which plans do not support")]
#[cause(Input: "rename the file or its folder")]
struct NoText;

/// The shots of an archive for the processes of a cluster; see [`ShotsTable`].
#[derive(Debug)]
pub struct ArchiveTable {
    groups: Arc<[Vec<Named>]>,
    columns: Arc<dyn Columns>,
    /// The same table without files.
    shape: ShotsTable,
}

impl ArchiveTable {
    /// The table of these files, which have an index or are stand-ins.
    ///
    /// # Errors
    /// A file without an index entry; an unknown current folder.
    pub fn of(sources: Vec<Source>, columns: Arc<dyn Columns>) -> Result<Self> {
        let named = |source: &Source| {
            let blake3 = source.blake3().ok_or(NotIndexed);
            let path = path::absolute(source.path()).map_err(IoError::on("locate the file"));
            let path = path.in_file(source.path())?.into_os_string().into_string();
            let path = path.map_err(|_not_unicode| NoText);
            Ok::<_, Error>(Named {
                blake3: blake3.in_file(source.path())?,
                path: path.in_file(source.path())?,
            })
        };
        let groups = apart(sources, GROUPS_MAX).into_iter();
        let groups = groups.map(|group| group.iter().map(named).collect());
        let groups: Vec<Vec<Named>> = groups.collect::<Result<_>>()?;
        Ok(Self::of_groups(groups, columns))
    }

    pub(super) fn of_groups(groups: Vec<Vec<Named>>, columns: Arc<dyn Columns>) -> Self {
        Self {
            groups: groups.into(),
            shape: ShotsTable::new(Vec::new(), Arc::clone(&columns), Arc::default()),
            columns,
        }
    }

    pub(super) fn groups(&self) -> &[Vec<Named>] {
        &self.groups
    }
}

#[async_trait]
impl TableProvider for ArchiveTable {
    fn schema(&self) -> SchemaRef {
        self.shape.schema()
    }

    fn table_type(&self) -> TableType {
        TableType::Base
    }

    fn supports_filters_pushdown(
        &self,
        filters: &[&Expr],
    ) -> Answer<Vec<TableProviderFilterPushDown>> {
        self.shape.supports_filters_pushdown(filters)
    }

    async fn scan(
        &self,
        _session: &dyn Session,
        projection: Option<&Vec<usize>>,
        filters: &[Expr],
        limit: Option<usize>,
    ) -> Answer<Arc<dyn ExecutionPlan>> {
        let reading = Reading {
            projection: projection.cloned(),
            filters: filters.to_vec(),
            limit,
        };
        let columns = Arc::clone(&self.columns);
        Ok(Arc::new(ShotsScan::of_groups(
            &self.groups,
            reading,
            columns,
        )?))
    }
}
