//! Controls with their residuals.

use super::{NetProducts, WriteNet, write_csv, write_parquet};
use crate::{
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_stages::triangulate::ControlResult;

pub(super) static TABLE: Declaration<WriteNet> = Declaration {
    path: "controls.parquet",
    what: "controls with residuals, and whether each control was kept",
    readers: "scripts",
    rows: "controls",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_parquet(path, of, &table(of)),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteNet> = Declaration {
    path: "controls.csv",
    what: "controls with residuals, as CSV",
    readers: "spreadsheets, scripts",
    rows: "controls",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_csv(path, table(of)),
    uses: &[],
};

fn table<'a>(of: &NetProducts<'a>) -> Table<'a> {
    Table::new(columns(), of.result.controls.iter().collect())
}

fn columns<'a>() -> Vec<Column<&'a ControlResult>> {
    type Row<'a> = &'a ControlResult;
    vec![
        column("point", Unit::None, "name of the point", |row: &Row| {
            row.point.clone()
        }),
        column(
            "x_m",
            Unit::Metre,
            "given east coordinate on the map, metres",
            |row: &Row| row.given_m[0],
        ),
        column(
            "y_m",
            Unit::Metre,
            "given north coordinate on the map, metres",
            |row: &Row| row.given_m[1],
        ),
        column(
            "dx_m",
            Unit::Metre,
            "given minus computed east coordinate, metres",
            |row: &Row| row.residual_m[0],
        ),
        column(
            "dy_m",
            Unit::Metre,
            "given minus computed north coordinate, metres",
            |row: &Row| row.residual_m[1],
        ),
        column(
            "scale_dx_m",
            Unit::Metre,
            "given minus computed east coordinate, from SCALE of the free figure, metres; used to detect gross errors",
            |row: &Row| row.scale_residual_m[0],
        ),
        column(
            "scale_dy_m",
            Unit::Metre,
            "given minus computed north coordinate, from SCALE of the free figure, metres; \
            used to detect gross errors",
            |row: &Row| row.scale_residual_m[1],
        ),
        column(
            "sigma_m",
            Unit::Metre,
            "a priori standard deviation of a coordinate, metres",
            |row: &Row| row.sigma_m,
        ),
        column(
            "kept",
            Unit::None,
            "whether the control was kept",
            |row: &Row| row.kept,
        ),
    ]
}
