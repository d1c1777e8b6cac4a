//! The document of a QGIS project (`.qgs`, the layout of version 3.22), with the elements that `QgsProject::read` needs.

use areograph_base::{minus::with_minus, style::IMAGE_COLOURS};
use maud::{Markup, html};

use super::map::Map;

/// Layout that the document follows.
const VERSION: &str = "3.22.16";
/// Five colours of the scale viridis, from low to high.
const COLOURS: [&str; 5] = [
    "68,1,84,255",
    "59,82,139,255",
    "33,145,140,255",
    "94,201,98,255",
    "253,231,37,255",
];
/// Beginning of the identifiers of layers; QGIS replaces those of up to ten letters.
const ID: &str = "areograph_layer_";
/// Colour of contours.
const BROWN: &str = "140,81,10,255";
/// Blend mode "multiply" of QGIS.
const MULTIPLY: &str = "6";
const NORMAL: &str = "0";

/// A layer of the map.
pub(super) struct Layer {
    /// Name in the list of layers.
    pub(super) name: String,
    /// Data source, relative to the project.
    pub(super) source: String,
    /// Its coordinate system as text.
    pub(super) wkt: String,
    pub(super) is_shown: bool,
    pub(super) form: Form,
}

/// What a layer shows, and how.
pub(super) enum Form {
    /// Points.
    Points,
    /// Points in five colours by a column with values in this range.
    Heights {
        column: &'static str,
        range: [f64; 2],
    },
    /// Arrows of residuals on the ground, so many times their length.
    Arrows { magnification: f64 },
    /// Polygons without a filling, labelled by a column.
    Outlines { label: &'static str },
    /// Lines, labelled by a column.
    Contours { label: &'static str },
    /// Brightness in this range.
    Brightness { range: [u8; 2] },
    /// Numbers of images, from 1 on, as colours under their names.
    Sources { images: Vec<String> },
    /// Heights in colours, multiplied with the layer below.
    Terrain { range: [f64; 2] },
    /// Heights under light from the north-west.
    Shaded,
}

impl Form {
    /// Geometry of a layer of vectors; `None` for rasters.
    const fn geometry(&self) -> Option<&'static str> {
        match self {
            Self::Points | Self::Heights { .. } | Self::Arrows { .. } => Some("Point"),
            Self::Contours { .. } => Some("Line"),
            Self::Outlines { .. } => Some("Polygon"),
            Self::Brightness { .. }
            | Self::Sources { .. }
            | Self::Terrain { .. }
            | Self::Shaded => None,
        }
    }

    const fn provider(&self) -> &'static str {
        if self.geometry().is_some() {
            "ogr"
        } else {
            "gdal"
        }
    }
}

/// The document with `layers` from the top of the map to its bottom.
pub(super) fn document(title: &str, map: &Map, layers: &[Layer]) -> String {
    let named: Vec<(String, &Layer)> = layers
        .iter()
        .enumerate()
        .map(|(index, layer)| (format!("{ID}{}", index + 1), layer))
        .collect();
    let [west, south, east, north] = map.extent_m.map(|metres| format!("{metres:.3}"));
    let qgis = html! {
        qgis projectname=(title) version=(VERSION) {
            title { (title) }
            projectCrs { (system(&map.wkt(), false)) }
            layer-tree-group {
                @for (id, layer) in &named {
                    layer-tree-layer id=(id) name=(layer.name) source=(layer.source) providerKey=(layer.form.provider())
                        expanded="0" checked=(if layer.is_shown { "Qt::Checked" } else { "Qt::Unchecked" }) {}
                }
            }
            mapcanvas name="theMapCanvas" annotationsVisible="1" {
                units { "meters" }
                extent { xmin { (west) } ymin { (south) } xmax { (east) } ymax { (north) } }
                destinationsrs { (system(&map.wkt(), false)) }
            }
            projectlayers {
                @for (id, layer) in &named { (layer_element(id, layer)) }
            }
            layerorder { @for (id, _) in &named { layer id=(id) {} } }
            properties {
                SpatialRefSys { ProjectionsEnabled type="int" { "1" } }
                Paths { Absolute type="bool" { "false" } }
                Measurement { DistanceUnits type="QString" { "meters" } AreaUnits type="QString" { "m2" } }
            }
            ProjectViewSettings UseProjectScales="0" {
                DefaultViewExtent xmin=(west) ymin=(south) xmax=(east) ymax=(north) {
                    (system(&map.wkt(), false))
                }
            }
        }
    };
    let head = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n";
    format!("{head}{}\n", qgis.into_string())
}

fn system(wkt: &str, is_geographic: bool) -> Markup {
    html! {
        spatialrefsys { wkt { (wkt) } geographicflag { (is_geographic) } }
    }
}

fn layer_element(id: &str, layer: &Layer) -> Markup {
    let form = &layer.form;
    let is_vector = form.geometry().is_some();
    let kind = if is_vector { "vector" } else { "raster" };
    let blend = if matches!(form, Form::Terrain { .. }) {
        MULTIPLY
    } else {
        NORMAL
    };
    let labels = if matches!(form, Form::Outlines { .. } | Form::Contours { .. }) {
        "1"
    } else {
        "0"
    };
    html! {
        maplayer type=(kind) geometry=[form.geometry()] labelsEnabled=(labels) hasScaleBasedVisibilityFlag="0" {
            id { (id) }
            datasource { (layer.source) }
            layername { (layer.name) }
            srs { (system(&layer.wkt, is_vector)) }
            provider encoding="UTF-8" { (form.provider()) }
            @if is_vector {
                (vector_style(form))
                layerGeometryType { (match form.geometry() { Some("Point") => "0", Some("Line") => "1", _ => "2" }) }
            } @else {
                pipe { (raster_style(form)) }
            }
            blendMode { (blend) }
            layerOpacity { "1" }
        }
    }
}

/// Options of a symbol, as QGIS writes them.
fn options(of: &[(&str, &str)]) -> Markup {
    html! {
        Option type="Map" {
            @for (name, value) in of { Option name=(name) type="QString" value=(value) {} }
        }
    }
}

/// A symbol of one layer of this class.
fn symbol(name: &str, kind: &str, class: &str, inside: &Markup) -> Markup {
    html! {
        symbol name=(name) type=(kind) alpha="1" clip_to_extent="1" force_rhr="0" {
            layer class=(class) enabled="1" locked="0" pass="0" { (inside) }
        }
    }
}

fn dot(name: &str, colour: &str) -> Markup {
    let of = options(&[
        ("name", "circle"),
        ("color", colour),
        ("outline_style", "no"),
        ("size", "1.6"),
        ("size_unit", "MM"),
    ]);
    symbol(name, "marker", "SimpleMarker", &of)
}

fn single(symbol: &Markup) -> Markup {
    html! { renderer-v2 type="singleSymbol" forceraster="0" symbollevels="0" enableorderby="0" { symbols { (symbol) } } }
}

fn vector_style(form: &Form) -> Markup {
    match form {
        Form::Heights { column, range } => classes(column, *range),
        Form::Arrows { magnification } => single(&arrow(*magnification)),
        Form::Outlines { label } => {
            let line = options(&[
                ("style", "no"),
                ("outline_color", "227,26,28,255"),
                ("outline_style", "solid"),
                ("outline_width", "0.5"),
                ("outline_width_unit", "MM"),
            ]);
            html! {
                (single(&symbol("0", "fill", "SimpleFill", &line)))
                (labels(label, "227,26,28,255", ["1", "PolygonGeometry"]))
            }
        }
        Form::Contours { label } => {
            let line = options(&[
                ("line_color", BROWN),
                ("line_style", "solid"),
                ("line_width", "0.2"),
                ("line_width_unit", "MM"),
            ]);
            html! {
                (single(&symbol("0", "line", "SimpleLine", &line)))
                (labels(label, BROWN, ["2", "LineGeometry"]))
            }
        }
        _ => single(&dot("0", "120,120,120,255")),
    }
}

/// Labels at a placement of QGIS for a kind of geometry.
fn labels(column: &str, colour: &str, [placement, geometry]: [&str; 2]) -> Markup {
    html! {
        labeling type="simple" {
            settings calloutType="simple" {
                text-style fieldName=(column) isExpression="0" fontSize="9" fontSizeUnit="Point" textColor=(colour)
                    textOpacity="1" {
                    text-buffer bufferDraw="1" bufferSize="0.8" bufferSizeUnits="MM" bufferColor="255,255,255,255" bufferOpacity="1" {}
                }
                placement placement=(placement) quadOffset="4" priority="5" polygonPlacementFlags="2" layerType=(geometry) {}
                rendering drawLabels="1" obstacle="1" fontMaxPixelSize="10000" maxNumLabels="2000" {}
            }
        }
    }
}

/// Five classes of equal width.
fn classes(column: &str, [least, most]: [f64; 2]) -> Markup {
    let width = (most - least) / 5.0;
    let edge = |class: usize| {
        if class == COLOURS.len() {
            most
        } else {
            width.mul_add(class_number(class), least)
        }
    };
    html! {
        renderer-v2 type="graduatedSymbol" attr=(column) graduatedMethod="GraduatedColor" forceraster="0" symbollevels="0" enableorderby="0" {
            ranges {
                @for class in 0..COLOURS.len() {
                    range symbol=(class) render="true" lower=(edge(class)) upper=(edge(class + 1))
                        label=(format!("{} to {}", whole(edge(class)), whole(edge(class + 1)))) {}
                }
            }
            symbols { @for (class, colour) in COLOURS.iter().enumerate() { (dot(&class.to_string(), colour)) } }
        }
    }
}

/// A number of a legend.
fn whole(value: f64) -> String {
    // Without the sign of a negative zero.
    with_minus(&format!("{:.0}", value.round() + 0.0))
}

#[allow(clippy::cast_precision_loss, reason = "there are five classes")]
const fn class_number(class: usize) -> f64 {
    class as f64
}

fn arrow(magnification: f64) -> Markup {
    let filling = options(&[
        ("color", "255,127,0,255"),
        ("style", "solid"),
        ("outline_style", "no"),
    ]);
    let shape = options(&[
        ("arrow_type", "0"),
        ("arrow_width", "0.3"),
        ("arrow_start_width", "0.3"),
        ("head_length", "1.2"),
        ("head_thickness", "0.8"),
        ("head_type", "0"),
        ("is_curved", "0"),
        ("is_repeated", "1"),
    ]);
    let line = html! { (shape) (symbol("@@0@0@0", "fill", "SimpleFill", &filling)) };
    let field = options(&[
        ("x_attribute", "residual_map_x_m"),
        ("y_attribute", "residual_map_y_m"),
        ("vector_field_type", "0"),
        ("scale", &magnification.to_string()),
        ("distance_unit", "MapUnit"),
        ("angle_orientation", "0"),
        ("angle_units", "0"),
    ]);
    let of = html! { (field) (symbol("@0@0", "line", "ArrowLine", &line)) };
    symbol("0", "marker", "VectorField", &of)
}

fn raster_style(form: &Form) -> Markup {
    match form {
        Form::Brightness {
            range: [black, white],
        } => html! {
            rasterrenderer type="singlebandgray" grayBand="1" gradient="BlackToWhite" opacity="1" alphaBand="-1" {
                contrastEnhancement {
                    minValue { (black) }
                    maxValue { (white) }
                    algorithm { "StretchToMinimumMaximum" }
                }
            }
        },
        Form::Sources { images } => html! {
            rasterrenderer type="paletted" band="1" opacity="1" alphaBand="-1" {
                colorPalette {
                    @for (index, image) in images.iter().enumerate() {
                        @let (_, [red, green, blue]) = IMAGE_COLOURS[index % IMAGE_COLOURS.len()];
                        @let colour = format!("#{red:02x}{green:02x}{blue:02x}");
                        paletteEntry value=(index + 1) color=(colour) alpha="255" label=(image) {}
                    }
                }
            }
        },
        Form::Terrain {
            range: [least, most],
        } => html! {
            rasterrenderer type="singlebandpseudocolor" band="1" opacity="1" alphaBand="-1"
                classificationMin=(least) classificationMax=(most) {
                rastershader {
                    colorrampshader colorRampType="INTERPOLATED" classificationMode="1" clip="0" minimumValue=(least) maximumValue=(most) {
                        @for (index, colour) in COLOURS.iter().enumerate() {
                            @let value = (most - least).mul_add(class_number(index) / 4.0, *least);
                            item value=(value) color=(hexadecimal(colour)) alpha="255" label=(whole(value)) {}
                        }
                    }
                }
            }
        },
        _ => html! {
            rasterrenderer type="hillshade" band="1" azimuth="315" angle="45" zfactor="1" multidirection="0" opacity="1" alphaBand="-1" {}
        },
    }
}

/// `r,g,b,a` as `#rrggbb`.
fn hexadecimal(colour: &str) -> String {
    let parts = colour
        .split(',')
        .take(3)
        .filter_map(|part| part.parse::<u8>().ok());
    parts.fold("#".to_owned(), |text, part| format!("{text}{part:02x}"))
}
