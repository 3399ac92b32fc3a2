//! Rules for every picture, checked on its data.

use std::sync::LazyLock;

use feedwave_contract::proto::{PocketSearch, SpindleBand, StabilityLobes, StabilityPocket, StabilityPoint};
use feedwave_cutting::SetpointBlock;
use feedwave_cutting::thinning::{DeviationTrace, ThinningSettings};
use feedwave_motion::kinematics::Setup;
use feedwave_program::Position;
use plotters::style::RGBColor;

use crate::figure::{Beyond, Figure, MILLISECONDS, Proportions, SECONDS, Shape};
use crate::layout::Page;
use crate::path_deviation::PathDeviationPicture;
use crate::theme::{self, Ink, Mark};
use crate::{FiveAxisPlots, FiveAxisSetup, LobesPicture, ThinningShown, canvas, tests};

/// Every kind of picture, made once for all rules.
static FIGURES: LazyLock<Vec<Figure>> = LazyLock::new(|| {
    let mut figures = tests::plots().figures();
    figures.extend(tests::thread::figures());
    figures.extend(tests::tool_oscillation::figures());
    figures.extend(five_axis(None));
    figures.extend(five_axis(Some(0.5)));
    figures.push(tests::run().figure());
    figures.push(lobes());
    let deviations = tests::deviations(false);
    figures.push(PathDeviationPicture { program: "mould.nc", deviations: &deviations, turning: false }.figure());
    figures
});

/// A program on a table that turns and tilts: C goes to and fro, A rises.
fn five_axis(interpolated_direction_tolerance_deg: Option<f64>) -> Vec<Figure> {
    let kinematics = tests::trunnion();
    let work = kinematics.work_frame_at(&kinematics.from_position(&Position::default()));
    let setup = FiveAxisSetup {
        columns: [(1, 1.0), (0, 1.0)],
        letters: ['C', 'A'],
        max_velocities_deg_per_s: [720.0, 50.0],
        directions: kinematics.rotary_directions(),
        work: Setup { work, tool_length_mm: 0.0 },
        cuts: vec![2..=3],
        close_lines: 2..=2,
        period_s: 1e-3,
    };
    let thinning = ThinningShown {
        settings: ThinningSettings { interpolated_direction_tolerance_deg, ..ThinningSettings::default() },
        deviations: DeviationTrace::default(),
        reversals_before: [30, 12],
        reversals_after: [2, 0],
        reversals_by_other_method: Some([4, 0]),
        times_s: [2.0, 1.0],
        blocks: [100, 90],
    };
    let mut plots = FiveAxisPlots::new(setup, Some(thinning));
    let block = |flicker: f64| {
        let rows = || (0..2_000).map(|row| f64::from(row) * 1e-3);
        SetpointBlock {
            first_index: 0,
            axes: vec![
                rows().map(|s| if s < 0.1 { 90.0 - 600.0 * s } else { 30.0 + s }).collect(),
                rows().map(|s| 20.0 * (6.0 * s).sin() + flicker * (200.0 * s).sin()).collect(),
            ],
            tool_direction: Vec::new(),
            path_position_mm: rows().map(|s| 10.0 * s).collect(),
            feed_mm_per_min: vec![600.0; 2_000],
            vibration_offset_mm: vec![0.0; 2_000],
            spindle_angle_deg: vec![0.0; 2_000],
            line: rows()
                .map(|s| {
                    if s < 0.1 {
                        1
                    } else if s < 1.0 {
                        2
                    } else {
                        3
                    }
                })
                .collect(),
            servo: None,
        }
    };
    plots.push_as_programmed(&block(0.5));
    plots.finish_as_programmed();
    plots.push_by_other_method(&block(0.2));
    plots.push(&block(0.0));
    plots.figures("five.nc")
}

fn lobes() -> Figure {
    let limit = |speed: f64| 4.0 + 3.0 * (speed / 300.0).sin();
    let speeds = || (0..200).map(|step| 2_000.0 + 50.0 * f64::from(step));
    let point = |spindle_rev_per_min: f64| StabilityPoint {
        spindle_rev_per_min,
        limit_mm: (spindle_rev_per_min < 11_000.0).then(|| limit(spindle_rev_per_min)),
        chatter_hz: 600.0 + 0.01 * spindle_rev_per_min,
        ..StabilityPoint::default()
    };
    let pocket = |spindle_rev_per_min: f64| StabilityPocket {
        band: Some(SpindleBand {
            above_rev_per_min: spindle_rev_per_min - 1_000.0,
            up_to_rev_per_min: spindle_rev_per_min + 1_000.0,
            spindle_rev_per_min,
        }),
        stable_mm: Some(0.8 * limit(spindle_rev_per_min)),
    };
    let lobes = StabilityLobes {
        search: Some(PocketSearch { margin: Some(0.15), ..PocketSearch::default() }),
        chart: speeds().map(point).collect(),
        pockets: [3_000.0, 5_000.0, 7_000.0].map(pocket).to_vec(),
        least_limit_mm: Some(1.0),
        radial_immersion: Some(0.5),
        ..StabilityLobes::default()
    };
    LobesPicture { subtitle: "milling".to_owned(), lobes: &lobes }.figure()
}

fn names<'a>(inks: impl IntoIterator<Item = &'a Ink>) -> Vec<String> {
    let mut names: Vec<String> =
        inks.into_iter().map(|ink| ink.name.to_string()).filter(|name| !name.is_empty()).collect();
    names.sort();
    names.dedup();
    names
}

#[test]
fn a_legend_shows_what_is_drawn_and_nothing_else() {
    for figure in FIGURES.iter() {
        let page = Page::of(figure);
        let drawn = || page.panels.iter().flat_map(|placed| placed.visible().map(|layer| &layer.ink));
        let legend = names(page.legend.iter().flat_map(|entry| &entry.inks));
        assert_eq!(legend, names(drawn()), "{}", figure.name);
        for entry in &page.legend {
            for ink in drawn().filter(|ink| ink.name == entry.name) {
                assert!(entry.inks.contains(ink), "{}: {}", figure.name, ink.name);
            }
            // One look for each kind of mark: the legend says which is meant.
            let kinds = entry.inks.iter().map(|ink| (std::mem::discriminant(&ink.mark), ink.color));
            let kinds: Vec<_> = kinds.collect();
            for (index, (kind, color)) in kinds.iter().enumerate() {
                assert!(kinds[index + 1..].iter().all(|(other, _)| other != kind), "{}: {}", figure.name, entry.name);
                assert!(kinds.iter().all(|(_, other)| other == color), "{}: {}", figure.name, entry.name);
            }
        }
        for placed in &page.panels {
            for layer in placed.visible().filter(|layer| layer.ink.name.is_empty()) {
                let explained = match &layer.shape {
                    Shape::Cells(_) => !page.colors.is_empty(),
                    Shape::Area(_) => true,
                    Shape::Dots(places) => {
                        places.iter().all(|place| placed.panel.labels.iter().any(|label| label.at == *place))
                    }
                    Shape::Path(_) | Shape::Arrow(..) => false,
                };
                assert!(explained, "{}: {}: something without a name", figure.name, placed.panel.title);
            }
        }
    }
}

#[test]
fn what_is_cut_off_is_said() {
    let mut said = 0;
    for figure in FIGURES.iter() {
        for placed in &Page::of(figure).panels {
            let notes = placed.notes.join(" ");
            for layer in &placed.panel.layers {
                let Beyond::Said(name) = &layer.beyond else { continue };
                let (Shape::Path(places) | Shape::Dots(places)) = &layer.shape else { continue };
                let outside = |place: &(f64, f64)| {
                    let beyond = |value: f64, range: &std::ops::Range<f64>| {
                        let margin = 1e-4 * (range.end - range.start);
                        value < range.start - margin || value > range.end + margin
                    };
                    beyond(place.0, &placed.x) || beyond(place.1, &placed.y)
                };
                if places.iter().any(outside) {
                    assert!(notes.contains(&format!("beyond the scale: {name}")), "{}: {name}: {notes}", figure.name);
                    said += 1;
                }
            }
        }
    }
    assert!(said > 3, "nothing was cut off");
}

#[test]
fn exaggeration_is_said() {
    let mut said = 0;
    for figure in FIGURES.iter() {
        for placed in &Page::of(figure).panels {
            let Some(times) = placed.exaggeration() else { continue };
            if placed.panel.proportions != Proportions::Free {
                assert!((times - 1.0).abs() < 1e-9, "{}: {times}", figure.name);
            } else if !(0.95..1.05).contains(&times) {
                assert!(placed.notes.join(" ").contains("magnified"), "{}: {}", figure.name, placed.panel.title);
                said += 1;
            }
        }
    }
    assert!(said > 3);
}

#[test]
fn axes_have_labels_with_units_and_time_goes_forwards() {
    for figure in FIGURES.iter() {
        for placed in &Page::of(figure).panels {
            let panel = placed.panel;
            if panel.proportions == Proportions::Bare {
                continue;
            }
            for axis in [&panel.x, &panel.y] {
                assert!(!axis.label.is_empty() && axis.range.start < axis.range.end, "{}: {axis:?}", figure.name);
                let counts = ["line of the program", "edge"].contains(&axis.label.as_str());
                assert!(counts || axis.text().ends_with(axis.unit.symbol) && !axis.unit.symbol.is_empty());
            }
            if [SECONDS, MILLISECONDS].contains(&panel.x.unit) {
                for layer in &panel.layers {
                    let Shape::Path(points) = &layer.shape else { continue };
                    let forwards = points.windows(2).all(|pair| pair[0].0 <= pair[1].0);
                    assert!(forwards, "{}: {}", figure.name, layer.ink.name);
                }
            }
        }
    }
}

#[test]
fn limits_are_named_where_they_are() {
    let mut limits = 0;
    for figure in FIGURES.iter() {
        for placed in &Page::of(figure).panels {
            let is_limit =
                |ink: &Ink| ink.color == theme::BAD && (ink.name.contains("limit") || ink.name == "tolerance");
            for layer in placed.panel.layers.iter().filter(|layer| is_limit(&layer.ink)) {
                let Shape::Path(points) = &layer.shape else { panic!("{}", figure.name) };
                let named = placed.panel.labels.iter().any(|label| label.at.1.abs() == points[0].1.abs());
                let is_curve = points.len() > 2;
                assert!(named || is_curve, "{}: {}", figure.name, layer.ink.name);
                limits += 1;
            }
        }
    }
    assert!(limits > 5);
}

#[test]
fn a_tolerance_is_drawn_only_on_what_it_bounds() {
    for (tolerance_deg, limits) in [(None, 0), (Some(0.5), 1)] {
        let figures = five_axis(tolerance_deg);
        let figure = figures.iter().find(|figure| figure.name == "thinning-deviation").unwrap();
        let page = Page::of(figure);
        assert!(
            figure.subtitle.contains("five.nc \u{b7} thinned as published \u{b7} 90 of 100 blocks"),
            "{}",
            figure.subtitle
        );
        let drawn = page.panels[1].panel.layers.iter().filter(|layer| layer.ink.name == "tolerance").count();
        assert_eq!(drawn, limits);
        assert_eq!(page.panels[1].notes.join(" ").contains("not bounded"), limits == 0);
    }
}

#[test]
fn rotary_axes_count_the_turns_inside_the_cuts_and_all_of_them() {
    let figures = five_axis(None);
    let page = Page::of(&figures[0]);
    let notes = page.panels[0].notes.join(" ");
    let inside = "reversals inside the cuts: 30 as programmed, 4 thinned by a fit, 2 thinned as published";
    assert!(notes.contains(inside), "{notes}");
    // The sine of C turns back four times in two seconds; the flicker of half a degree far more often.
    assert!(notes.contains(", 4 thinned as published"), "{notes}");
    assert!(page.panels.iter().any(|placed| placed.notes.join(" ").contains("the swing before and after the cuts")));
}

#[test]
fn texts_have_room() {
    theme::load_font().unwrap();
    for figure in FIGURES.iter() {
        let (width, page) = (f64::from(figure.size.0), Page::of(figure));
        assert!(theme::text_width(&figure.title, theme::TITLE_SIZE) < width - 48.0);
        for entry in &page.legend {
            let end = entry.at.0 + 47.0 + theme::text_width(&entry.name, theme::LEGEND_SIZE);
            assert!(end < width, "{}: {}", figure.name, entry.name);
        }
        for placed in &page.panels {
            assert!(placed.plot.width > 150.0 && placed.plot.height > 60.0, "{}: {:?}", figure.name, placed.plot);
            let fits = |line: &String, size| theme::text_width(line, size) <= placed.plot.width + 1.0;
            assert!(placed.title.iter().all(|line| fits(line, theme::PANEL_TITLE_SIZE)), "{}", figure.name);
            assert!(
                placed.notes.iter().all(|line| fits(line, theme::NOTE_SIZE)),
                "{}: {:?}",
                figure.name,
                placed.notes
            );
            let label_height = theme::text_width(&placed.panel.y.text(), theme::AXIS_SIZE);
            assert!(label_height < placed.rect.height, "{}: {}", figure.name, placed.panel.y.text());
        }
    }
}

#[test]
fn every_panel_renders() {
    for figure in FIGURES.iter() {
        let pixels = canvas::pixels(figure).unwrap();
        let width = figure.size.0 as usize;
        assert_eq!(pixels.len(), 3 * width * figure.size.1 as usize);
        for placed in &Page::of(figure).panels {
            let plot = placed.plot;
            let rows = plot.top as usize + 2..(plot.top + plot.height) as usize - 2;
            let columns = plot.left as usize + 2..(plot.left + plot.width) as usize - 2;
            // Darker than the grid on paper.
            let inked = |index: &usize| pixels[*index] < 200 || pixels[index + 1] < 200 || pixels[index + 2] < 200;
            let places = rows.flat_map(|row| columns.clone().map(move |column| 3 * (row * width + column)));
            let enough = places.filter(inked).take(41).count() > 40;
            let empty = placed.visible().next().is_none();
            assert!(empty || enough, "{}: {}: hardly anything is drawn", figure.name, placed.panel.title);
        }
    }
}

/// Colours in the eye of a person without receptors for red or green (Viénot, Brettel and Mollon, "Digital video
/// colourmaps for checking the legibility of displays by dichromats", 1999), as lightness and two colour differences
/// (CIELAB).
fn seen(color: RGBColor, without_red: Option<bool>) -> [f64; 3] {
    let linear = |byte: u8| {
        let share = f64::from(byte) / 255.0;
        if share <= 0.040_45 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    };
    let [r, g, b] = [color.0, color.1, color.2].map(linear);
    let [r, g, b] = match without_red {
        None => [r, g, b],
        Some(true) => [0.112_38 * r + 0.887_62 * g, 0.112_38 * r + 0.887_62 * g, 0.004_01 * r - 0.004_01 * g + b],
        Some(false) => [0.292_75 * r + 0.707_25 * g, 0.292_75 * r + 0.707_25 * g, -0.022_34 * r + 0.022_34 * g + b],
    };
    let xyz = [
        (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505,
        0.2126 * r + 0.7152 * g + 0.0722 * b,
        (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089,
    ];
    let [x, y, z] =
        xyz.map(|share: f64| if share > 0.008_856 { share.max(0.0).cbrt() } else { 7.787 * share + 16.0 / 116.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The colour on white paper.
fn on_paper(ink: &Ink) -> RGBColor {
    let Mark::Fill { opacity } = ink.mark else { return ink.color };
    let mix = |byte: u8| (255.0 - opacity * (255.0 - f64::from(byte))) as u8;
    RGBColor(mix(ink.color.0), mix(ink.color.1), mix(ink.color.2))
}

#[test]
fn inks_of_one_picture_can_be_told_apart_without_seeing_red_or_green() {
    /// About four times what a trained eye just sees.
    const APART: f64 = 9.0;
    for figure in FIGURES.iter() {
        let page = Page::of(figure);
        let inks: Vec<&Ink> = page.legend.iter().flat_map(|entry| &entry.inks).collect();
        for (index, one) in inks.iter().enumerate() {
            for other in &inks[index + 1..] {
                let width = |ink: &Ink| if let Mark::Line { width } = ink.mark { width } else { 0.0 };
                let alike = std::mem::discriminant(&one.mark) == std::mem::discriminant(&other.mark)
                    && (width(one) - width(other)).abs() < 1.5;
                if one.name == other.name || !alike {
                    continue;
                }
                for eye in [None, Some(true), Some(false)] {
                    let [a, b] = [one, other].map(|ink| seen(on_paper(ink), eye));
                    let apart = (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt();
                    assert!(apart > APART, "{}: {} and {}: {apart:.1} ({eye:?})", figure.name, one.name, other.name);
                }
            }
        }
    }
}
