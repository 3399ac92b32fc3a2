use super::fft::Fft;
use super::*;

const RATE_HZ: f64 = 10_000.0;

fn config() -> SpectrumConfig {
    SpectrumConfig { samples: 4096, min_frequency_hz: 20.0, noise_floor: 1e-4, harmonic_tolerance_hz: 3.0, edges: 4 }
}

#[test]
fn the_transform_is_the_sum_it_stands_for() {
    let data: Vec<[f64; 2]> = (0..64).map(|i| [libm::sin(f64::from(i * i)), libm::cos(f64::from(3 * i))]).collect();
    let mut transformed = data.clone();
    Fft::new(64).transform(&mut transformed);
    for (bin, value) in transformed.iter().enumerate() {
        let mut sum = [0.0; 2];
        for (index, [re, im]) in data.iter().enumerate() {
            let angle = -TAU * (bin * index) as f64 / 64.0;
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            sum[0] += re * cos - im * sin;
            sum[1] += re * sin + im * cos;
        }
        assert!((value[0] - sum[0]).abs() < 1e-11 && (value[1] - sum[1]).abs() < 1e-11, "bin {bin}");
    }
}

#[test]
fn peaks_between_bins_are_interpolated() {
    let config = config();
    let mut analyser = Analyser::new(config.samples);
    for step in 0..20 {
        let frequency = 400.0 + 0.37 * f64::from(step);
        let mut record = Record::new(config.samples);
        // More samples than the ring holds: only the last ones count.
        for index in 0..5000 {
            let phase = TAU * frequency * f64::from(index) / RATE_HZ;
            record.push([7.0 + 0.03 * libm::sin(phase), -2.0 + 0.04 * libm::cos(phase + 0.3)]);
        }
        let (found, amplitude) = analyser.line(&record, &config, RATE_HZ).unwrap();
        assert!((found - frequency).abs() < 2e-3, "{found} for {frequency}");
        assert!((amplitude - 0.05).abs() < 5e-6, "{amplitude} for 0.05");
    }
}

/// The line that is found of one of 0.01 mm at this frequency, beside noise of 0.1 µm from a fixed sequence.
fn found(frequency_hz: f64, config: &SpectrumConfig) -> Option<(f64, f64)> {
    let mut record = Record::new(config.samples);
    let mut state = 1_u32;
    for index in 0..config.samples {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = 1e-4 * (f64::from(state) / f64::from(u32::MAX) - 0.5);
        record.push([0.01 * libm::sin(TAU * frequency_hz * f64::from(index) / RATE_HZ + 0.4) + noise, noise]);
    }
    Analyser::new(config.samples).line(&record, config, RATE_HZ)
}

#[test]
fn a_line_outside_of_the_range_is_no_line_within_it() {
    // 9.8 Hz from bin to bin: the lines below are within a few bins of 40 Hz, the last ones of half the sample rate.
    let config = SpectrumConfig { samples: 1024, min_frequency_hz: 40.0, ..config() };
    for frequency_hz in [12.0, 16.7, 25.0, 33.3, 38.0, 4_997.0, 5_000.5] {
        let (found_hz, amplitude) = found(frequency_hz, &config).expect("noise has lines");
        assert!(amplitude < 5e-5, "{frequency_hz} Hz is taken for {found_hz} Hz with {amplitude} mm");
    }
}

#[test]
fn a_line_just_above_the_lowest_frequency_is_what_it_is() {
    let config = SpectrumConfig { samples: 1024, min_frequency_hz: 40.0, ..config() };
    for frequency_hz in [41.0, 43.0, 48.0] {
        let (found_hz, amplitude) = found(frequency_hz, &config).expect("a line");
        assert!((found_hz - frequency_hz).abs() < 0.2 && (amplitude - 0.01).abs() < 2e-4, "{found_hz} {amplitude}");
    }
}

#[test]
fn an_unfilled_or_silent_record_has_no_line() {
    let config = config();
    let mut analyser = Analyser::new(config.samples);
    let mut record = Record::new(config.samples);
    record.push([1.0, 1.0]);
    assert_eq!(analyser.line(&record, &config, RATE_HZ), None);
    record.repeat(u64::MAX);
    assert_eq!(analyser.line(&record, &config, RATE_HZ), None);
}

#[test]
fn chatter_is_what_no_harmonic_explains() {
    let config = config();
    // 3000 rev/min = 50 Hz, edge passing 200 Hz.
    let origin_of = |hz| origin(hz, 0.01, Some(3000.0), &config);
    assert_eq!(origin_of(401.0), LineOrigin::EdgePassing(2));
    assert_eq!(origin_of(148.0), LineOrigin::Spindle(3));
    assert_eq!(origin_of(427.0), LineOrigin::Chatter);
    assert_eq!(origin_of(30.0), LineOrigin::Chatter);
    assert_eq!(origin(427.0, 1e-4, Some(3000.0), &config), LineOrigin::Noise);
    assert_eq!(origin(427.0, 0.01, None, &config), LineOrigin::Undetermined);
    // 6 Hz rotation with a tolerance of 3 Hz: every frequency would be a harmonic.
    assert_eq!(origin(427.0, 0.01, Some(360.0), &config), LineOrigin::Undetermined);
}

#[test]
fn an_acceleration_amplitude_becomes_a_displacement() {
    let line = SpectralLine { frequency_hz: 100.0, amplitude: 394.784_176_043_574_3, origin: LineOrigin::Chatter };
    assert!((line.displacement_amplitude_mm() - 0.001).abs() < 1e-15);
}

#[test]
fn a_kept_record_is_its_samples_and_goes_on_the_same() {
    let config = config();
    let mut record = Record::new(config.samples);
    let size = |record: &Record| postcard::to_allocvec(record).unwrap().len();
    let sample = |index: u32| [libm::sin(0.3 * f64::from(index)), f64::from(index % 7)];
    // Nothing, some, and more than fits in; then emptied.
    for (until, expected) in [(0, 3), (100, 3 + 16 * 100), (9_000, 4 + 16 * 4096)] {
        (0..until).for_each(|index| record.push(sample(index)));
        assert_eq!(size(&record), expected, "{until} samples");
        let bytes = postcard::to_allocvec(&record).unwrap();
        let mut restored: Record = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(postcard::to_allocvec(&restored).unwrap(), bytes);
        let mut went_on = record.clone();
        for index in 5..4_005 {
            restored.push(sample(index));
            went_on.push(sample(index));
        }
        let line = |record: &Record| Analyser::new(config.samples).line(record, &config, RATE_HZ);
        assert_eq!(line(&restored), line(&went_on));
        record.clear();
        assert_eq!(size(&record), 3);
    }
    for (length, filled) in [(0_u32, 0), (96, 0), (1 << 17, 0), (64, 65)] {
        let bytes = postcard::to_allocvec(&(length, vec![[0.0; 2]; filled])).unwrap();
        assert!(postcard::from_bytes::<Record>(&bytes).is_err(), "{filled} in {length}");
    }
}
