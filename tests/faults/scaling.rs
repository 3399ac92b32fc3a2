//! Time and memory against the size of a program, for what the language has: four times the program takes about four times
//! the time and no more memory. Part of the long form: `tests/faults/long.sh`.

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::{CreateJobRequest, JobState};
use feedwave_tests::{Server, upload};

use crate::FEEDWAVE;

/// A program without its repeated part is this, then that.
struct Construct {
    name: &'static str,
    machine: &'static str,
    head: &'static str,
    /// One repetition, by its number.
    body: fn(u64) -> String,
    tail: &'static str,
    /// Repetitions of the smallest of three programs.
    count: u64,
}

const MILL: &str = "G21 G90 G94 G17\nT1 M6\nS3000 M3\nG0 X0 Y0 Z5\n";
/// A tool of radius 2 mm in the table of offsets.
const COMPENSATED: &str = "G21 G90 G94 G17\nT1 M6\nS3000 M3\nG10 L12 P1 R2.\nG10 L13 P1 R0\nG0 X0 Y-20 Z5\n";
const LATHE: &str = "G21 G97 G95\nT0101\nS800 M3\nG0 X100. Z5.\n";

const CONSTRUCTS: &[Construct] = &[
    of("lines", MILL, 20_000, |n| format!("G1 X{} Y{} F800\n", n % 300, (n * 7) % 200)),
    of("short lines", MILL, 40_000, |n| format!("G1 X{}.{:03} Y{} F800\n", n % 100, n % 1_000, n % 2)),
    of("short lines rounded", "G21 G90 G94 G17\nG64 P0.05\nS3000 M3\nG0 X0 Y0 Z5\n", 10_000, |n| {
        format!("G1 X{}.{} Y{} F800\n", n / 10 % 300, n % 10, n % 2)
    }),
    of("arcs", MILL, 5_000, |n| format!("G2 X{} Y0 R100 F800\n", 10 * (1 + n % 2))),
    of("helices", MILL, 5_000, |n| format!("G3 X0 Y0 Z-{} I5 F800\n", n % 5)),
    of("rapids", MILL, 20_000, |n| format!("G0 X{} Y{}\n", n % 300, n % 200)),
    of("dwells", MILL, 20_000, |_| "G4 P0.001\n".to_owned()),
    of("drilling cycles", MILL, 5_000, |n| format!("G81 X{} Y{} Z-5 R2 F200\n", n % 300, n % 200)),
    of("pecking cycles", MILL, 2_000, |n| format!("G83 X{} Y{} Z-5 R2 Q1 F200\n", n % 300, n % 200)),
    of("spindle speeds", MILL, 5_000, |n| format!("S{} M3\nG1 X{} F500\n", 500 + n % 5_000, n % 300)),
    of("feeds", MILL, 20_000, |n| format!("G1 X{} F{}\n", n % 300, 100 + n % 900)),
    of("rotations", MILL, 5_000, |n| format!("G68 X0 Y0 R{}\nG1 X{} F500\nG69\n", n % 360, n % 50)),
    of("offsets", MILL, 10_000, |n| format!("G52 X{}\nG1 X{} F500\n", n % 10, n % 50)),
    of("comments", MILL, 50_000, |n| format!("(a comment that says {n})\n")),
    of("blank lines", MILL, 200_000, |_| "\n".to_owned()),
    of("expressions", MILL, 10_000, |n| format!("#100=[#100+{n}*SIN[{}]]\n", n % 360)),
    of("jumps", MILL, 5_000, |n| format!("IF [1 EQ 1] GOTO {n}\nN{n} G1 X{} F500\n", n % 300)),
    Construct {
        tail: "M30\nO9999\n#100=#1\nG1 X[#1 MOD 300] F500\nM99\n",
        ..of("calls", MILL, 5_000, |n| format!("G65 P9999 A{n}.\n"))
    },
    of("words that are not known", MILL, 20_000, |n| format!("G1 X1 QQ{n} @\n")),
    of("errors in every line", MILL, 20_000, |n| format!("G1 X[{n}\n")),
    of("compensated contours", COMPENSATED, 2_000, |n| {
        format!("G41 D1 G1 X{} Y0 F500\nX{} Y20\nG40 X0 Y-20\n", 20 + n % 20, 20 + n % 20)
    }),
    lathe("cylinders", 5_000, |n| format!("G1 X{}. Z-{}. F0.2\n", 50 + n % 40, n % 100)),
    lathe("threads", 200, |n| format!("G0 X40. Z5.\nG33 X40. Z-{}. F1.5\n", 20 + n % 3)),
    lathe("constant surface speed", 2_000, |n| format!("G96 S200\nG1 X{}. F0.2\nG97 S800\n", 40 + n % 50)),
];

const fn of(name: &'static str, head: &'static str, count: u64, body: fn(u64) -> String) -> Construct {
    Construct { name, machine: "machines/mill", head, body, tail: "M30\n", count }
}

const fn lathe(name: &'static str, count: u64, body: fn(u64) -> String) -> Construct {
    Construct { name, machine: "machines/lathe", head: LATHE, body, tail: "M30\n", count }
}

impl Construct {
    fn program(&self, times: u64) -> Bytes {
        let body: String = (1..=self.count * times).map(self.body).collect();
        Bytes::from(format!("{}{body}{}", self.head, self.tail))
    }
}

/// Unit of these times; Linux shows the same one on every machine, whatever its clock.
const TICKS_PER_SECOND: f64 = 100.0;

/// What validating a program took.
struct Taken {
    cpu_s: f64,
    peak_bytes: u64,
    state: JobState,
}

/// Time that a process has computed so far, s, by the operating system's account.
fn cpu_s(pid: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).expect("the process is accounted");
    // Behind the name in parentheses: user and system time are fields 14 and 15.
    let fields: Vec<&str> = stat.rsplit_once(')').expect("a name").1.split_whitespace().collect();
    let ticks: f64 = fields[11..13].iter().map(|field| field.parse::<f64>().expect("a number")).sum();
    ticks / TICKS_PER_SECOND
}

async fn take(construct: &Construct, times: u64) -> Taken {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    clients.submit("M30\n").await;
    let program = upload(&mut clients, &construct.program(times)).await.expect("the upload is taken");
    let before = cpu_s(server.pid());
    let request = CreateJobRequest {
        machine: construct.machine.to_owned(),
        source: Some(Source::Program(program)),
        interpolation_period_us: 20_000,
        ..CreateJobRequest::default()
    };
    let job = clients.jobs.create_job(request).await.expect("the job is created").into_inner().job.expect("a job");
    let state = clients.validated(&job.name).await.job.state();
    Taken { cpu_s: cpu_s(server.pid()) - before, peak_bytes: server.peak_resident_bytes(), state }
}

#[tokio::test]
#[ignore = "minutes: part of the long form"]
async fn four_times_the_program_takes_four_times_the_time_and_no_more_memory() {
    let mut failed = Vec::new();
    println!("construct                  verdict     CPU 1x, 2x, 4x / s          peak 1x, 2x, 4x / MB");
    for construct in CONSTRUCTS {
        let mut taken = Vec::new();
        for times in [1, 2, 4] {
            taken.push(take(construct, times).await);
        }
        let seconds: Vec<f64> = taken.iter().map(|taken| taken.cpu_s).collect();
        let megabytes: Vec<f64> = taken.iter().map(|taken| taken.peak_bytes as f64 / 1e6).collect();
        println!("{:<26} {:<10?} {seconds:>8.2?} {megabytes:>8.1?}", construct.name, taken[2].state);
        // A quadratic one would take sixteen times as long; half a second is the account's own grain and the service's start.
        if seconds[2] > 8.0 * seconds[0] + 0.5 {
            failed.push(format!("{}: {seconds:.2?} s", construct.name));
        }
        // Findings and reports are bounded, and so is everything else but the program itself.
        if megabytes[2] > 1.5 * megabytes[0] + 30.0 {
            failed.push(format!("{}: {megabytes:.1?} MB", construct.name));
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
