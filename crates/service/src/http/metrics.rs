//! Metrics for Prometheus. Labels are routes, methods, states: never a path, a site, a file or a token.

use std::{fmt::Write as _, time::Duration};

use prometheus_client::{
    encoding::{EncodeLabelSet, text::encode},
    metrics::{counter::Counter, family::Family, histogram::Histogram},
    registry::{Registry, Unit},
};

/// Upper ends of the histogram, seconds.
const BUCKETS_S: [f64; 9] = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Labels {
    method: &'static str,
    route: String,
    status: u16,
}

/// Answered requests.
#[derive(Debug)]
pub(super) struct Metrics {
    registry: Registry,
    requests: Family<Labels, Counter>,
    seconds: Histogram,
}

impl Metrics {
    pub(super) fn new() -> Self {
        let requests = Family::<Labels, Counter>::default();
        let seconds = Histogram::new(BUCKETS_S);
        let mut registry = Registry::with_prefix("areograph");
        registry.register(
            "http_requests",
            "Requests by method, route and status",
            requests.clone(),
        );
        registry.register_with_unit(
            "http_request_duration",
            "Time until a response began",
            Unit::Seconds,
            seconds.clone(),
        );
        Self {
            registry,
            requests,
            seconds,
        }
    }

    /// Records a request; `route` is a defined one, with its parameters by name.
    pub(super) fn note(&self, method: &'static str, route: &str, status: u16, took: Duration) {
        let labels = Labels {
            method,
            route: route.to_owned(),
            status,
        };
        self.requests.get_or_create(&labels).inc();
        self.seconds.observe(took.as_secs_f64());
    }

    /// The text for Prometheus, with current `gauges` (name, help, label if any, value).
    pub(super) fn text(&self, gauges: &[Gauge]) -> String {
        let mut own = String::new();
        // Writing to a string cannot fail.
        let _ = encode(&mut own, &self.registry);
        let mut text = String::new();
        let mut named = "";
        for gauge in gauges {
            if gauge.name != named {
                let _ = writeln!(text, "# HELP areograph_{} {}", gauge.name, gauge.help);
                let _ = writeln!(text, "# TYPE areograph_{} gauge", gauge.name);
                named = gauge.name;
            }
            let label = match gauge.label {
                Some((name, value)) => format!("{{{name}=\"{value}\"}}"),
                None => String::new(),
            };
            let _ = writeln!(text, "areograph_{}{label} {}", gauge.name, gauge.value);
        }
        text + &own
    }
}

/// A current value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gauge {
    pub(super) name: &'static str,
    pub(super) help: &'static str,
    pub(super) label: Option<(&'static str, &'static str)>,
    pub(super) value: f64,
}

impl Gauge {
    pub(super) const fn plain(name: &'static str, help: &'static str, value: f64) -> Self {
        Self {
            name,
            help,
            label: None,
            value,
        }
    }
}
