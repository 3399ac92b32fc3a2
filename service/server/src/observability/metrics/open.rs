//! Figures in the text form of OpenMetrics 1.0, which Prometheus asks for where it can.

use std::fmt::Write as _;

use http::HeaderMap;
use prometheus::proto::{LabelPair, MetricFamily, MetricType};

use crate::accept::{self, Offer};

/// The type of the form.
pub(crate) const CONTENT_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Units in which names of metrics end here.
const UNITS: [&str; 6] = ["seconds", "bytes", "meters", "hertz", "meters_per_second", "meters_per_second_squared"];

/// The forms of figures: whether it is this one.
const OFFERS: [Offer<bool>; 2] =
    [Offer { form: false, types: &["text/plain"] }, Offer { form: true, types: &["application/openmetrics-text"] }];

/// Whether a client prefers this form to the plain one.
pub(crate) fn is_preferred(headers: &HeaderMap) -> bool {
    accept::preferred(headers, &OFFERS).unwrap_or(false)
}

/// Writes families of metrics.
pub(crate) fn write(families: &[MetricFamily]) -> String {
    let mut out = String::new();
    for family in families {
        let (kind, name) = match family.get_field_type() {
            // The suffix belongs to the sample.
            MetricType::COUNTER => ("counter", family.name().strip_suffix("_total").unwrap_or(family.name())),
            MetricType::HISTOGRAM => ("histogram", family.name()),
            MetricType::GAUGE => ("gauge", family.name()),
            _ => ("unknown", family.name()),
        };
        let _ = writeln!(out, "# TYPE {name} {kind}");
        let longest = UNITS.iter().filter(|unit| name.ends_with(&format!("_{unit}"))).max_by_key(|unit| unit.len());
        if let Some(unit) = longest {
            let _ = writeln!(out, "# UNIT {name} {unit}");
        }
        let _ = writeln!(out, "# HELP {name} {}", escaped(family.help()));
        for metric in family.get_metric() {
            let labels = metric.get_label();
            match family.get_field_type() {
                MetricType::COUNTER => {
                    sample(&mut out, &format!("{name}_total"), labels, None, metric.get_counter().get_value());
                }
                MetricType::HISTOGRAM => {
                    let histogram = metric.get_histogram();
                    let bucket = format!("{name}_bucket");
                    for step in histogram.get_bucket() {
                        let upper = bound(step.upper_bound());
                        sample(&mut out, &bucket, labels, Some(&upper), step.cumulative_count() as f64);
                    }
                    sample(&mut out, &bucket, labels, Some("+Inf"), histogram.get_sample_count() as f64);
                    sample(&mut out, &format!("{name}_sum"), labels, None, histogram.get_sample_sum());
                    sample(&mut out, &format!("{name}_count"), labels, None, histogram.get_sample_count() as f64);
                }
                _ => sample(&mut out, name, labels, None, metric.get_gauge().get_value()),
            }
        }
    }
    out.push_str("# EOF\n");
    out
}

/// A bound of a bucket as the form wants it: always with a point.
fn bound(value: f64) -> String {
    format!("{value:?}")
}

fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

fn sample(out: &mut String, name: &str, labels: &[LabelPair], le: Option<&str>, value: f64) {
    out.push_str(name);
    let named = labels.iter().map(|label| (label.name(), label.value()));
    let all: Vec<String> =
        named.chain(le.map(|le| ("le", le))).map(|(name, value)| format!("{name}=\"{}\"", escaped(value))).collect();
    if !all.is_empty() {
        let _ = write!(out, "{{{}}}", all.join(","));
    }
    let _ = writeln!(out, " {value}");
}

#[cfg(test)]
mod tests {
    use prometheus::{Histogram, HistogramOpts, IntCounterVec, IntGauge, Opts, Registry};

    use super::*;

    #[test]
    fn every_sort_of_metric_is_written_as_the_form_wants_it() {
        let registry = Registry::new();
        let calls = IntCounterVec::new(Opts::new("calls_total", "Calls \"ended\"."), &["method"]).unwrap();
        let queue = IntGauge::new("queue", "Waiting.").unwrap();
        let times = Histogram::with_opts(HistogramOpts::new("read_seconds", "Time.").buckets(vec![0.5, 1.0])).unwrap();
        registry.register(Box::new(calls.clone())).unwrap();
        registry.register(Box::new(queue.clone())).unwrap();
        registry.register(Box::new(times.clone())).unwrap();
        calls.with_label_values(&["a\"b"]).inc_by(3);
        queue.set(7);
        times.observe(0.75);
        let expected = "# TYPE calls counter\n# HELP calls Calls \\\"ended\\\".\ncalls_total{method=\"a\\\"b\"} 3\n\
                        # TYPE queue gauge\n# HELP queue Waiting.\nqueue 7\n\
                        # TYPE read_seconds histogram\n# UNIT read_seconds seconds\n# HELP read_seconds Time.\n\
                        read_seconds_bucket{le=\"0.5\"} 0\nread_seconds_bucket{le=\"1.0\"} 1\n\
                        read_seconds_bucket{le=\"+Inf\"} 1\nread_seconds_sum 0.75\nread_seconds_count 1\n# EOF\n";
        assert_eq!(write(&registry.gather()), expected);
    }

    #[test]
    fn the_form_is_sent_to_who_prefers_it() {
        let is_preferred =
            |accept: &str| is_preferred(&HeaderMap::from_iter([(http::header::ACCEPT, accept.parse().unwrap())]));
        let of_prometheus = "application/openmetrics-text;version=1.0.0,application/openmetrics-text;version=0.0.1;q=0.75,\
                             text/plain;version=0.0.4;q=0.5,*/*;q=0.1";
        assert!(is_preferred(of_prometheus));
        let of_others = "text/plain;version=0.0.4, application/openmetrics-text;q=0.5";
        for accept in ["", "*/*", "text/plain", "application/openmetrics-text;q=0", of_others] {
            assert!(!is_preferred(accept), "{accept}");
        }
    }
}
