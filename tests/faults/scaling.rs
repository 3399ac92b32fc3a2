//! Time and memory against the size of a program, for what the language has: four times the program takes about four times
//! the time and no more memory. Part of the long form: `tests/faults/long.sh`.

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::{CreateJobRequest, JobState};
use feedwave_tests::{Server, upload};
use tokio::process::Command;

use crate::FEEDWAVE;

/// A program without its repeated part is this, then that.
struct Construct {
    name: &'static str,
    machine: &'static str,
    /// Files below `tests/fixtures` that the service is given first: a profile for `machine`, and tools.
    files: &'static [&'static str],
    tools: &'static [&'static str],
    head: &'static str,
    /// One repetition, by its number.
    body: fn(u64) -> String,
    tail: &'static str,
    /// Repetitions of the smallest of three programs.
    count: u64,
    /// Long, so that the language is what takes time; a vibration wants a short one.
    period_us: u32,
    /// What comes of its jobs.
    state: JobState,
}

const PERIOD_US: u32 = 20_000;
const VIBRATING_PERIOD_US: u32 = 1_000;

const MILL: &str = "G21 G90 G94 G17\nT1 M6\nS3000 M3\nG0 X0 Y0 Z5\n";
/// A tool of radius 2 mm in the table of offsets.
const COMPENSATED: &str = "G21 G90 G94 G17\nT1 M6\nS3000 M3\nG10 L12 P1 R2.\nG10 L13 P1 R0\nG0 X0 Y-20 Z5\n";
const FACE_MILL: &str = "G21 G90 G94 G17 G54\nT4 M6\nS600 M3\nG0 X-70. Y0. Z5.\nG202 P1 D1.\n";
const FIVE_AXES: &str =
    "G21 G17 G90 G94 G54\nG10 L10 P1 R100.\nT1 M6\nS12000 M3\nG0 A-20. C0.\nG43.4 H1\nG0 X0 Y0 Z10.\n";
/// Of G-code system A.
const LATHE_A: &str = "G21 G97 G99\nT0101\nS800 M3\nG0 X100. Z5.\n";
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
    of("words that are not known", MILL, 20_000, |n| format!("G1 X1 QQ{n} @\n")).refused(),
    of("errors in every line", MILL, 20_000, |n| format!("G1 X[{n}\n")).refused(),
    of("compensated contours", COMPENSATED, 2_000, |n| {
        format!("G41 D1 G1 X{} Y0 F500\nX{} Y20\nG40 X0 Y-20\n", 20 + n % 20, 20 + n % 20)
    }),
    lathe("cylinders", 5_000, |n| format!("G1 X{}. Z-{}. F0.2\n", 50 + n % 40, n % 100)),
    lathe("threads", 200, |n| format!("G0 X40. Z5.\nG33 X40. Z-{}. F1.5\n", 20 + n % 3)),
    of("inverse time", MILL, 20_000, |n| format!("G93 G1 X{} Y{} F{}\n", n % 300, n % 200, 50 + n % 50)),
    of("polar coordinates", MILL, 10_000, |n| format!("G16\nG1 X{} Y{} F800\nG15\n", 20 + n % 100, n % 360)),
    of("loops in loops", MILL, 500, |_| {
        "#1=0\nWHILE [#1 LT 20] DO1\n#2=0\nWHILE [#2 LT 5] DO2\nG1 X#1 Y#2 F800\n#2=#2+1\nEND2\n#1=#1+1\nEND1\n".to_owned()
    }),
    on("linuxcnc", &["posts/linuxcnc.toml"], MILL, "M30\n", |n| {
        format!("G1 X0 Y0 F800\nG5 X{} Y0 I2 J4 P-2 Q-4\n", 10 + n % 10)
    })
    .named("splines", 2_000),
    on("linuxcnc", &["posts/linuxcnc.toml"], MILL, "M30\n", |n| {
        format!("G1 X0 Y0 F800\nG5.2 P1 L3 X2 Y4\nX{} Y4 P1\nX12 Y0 P1\nG5.3\n", 6 + n % 4)
    })
    .named("NURBS", 2_000),
    Construct {
        tools: &["tools/face-mill-120"],
        ..on("oscillating", &["oscillation-mill.toml", "oscillation-tools.toml"], FACE_MILL, "G203\nM30\n", |n| {
            format!("G1 X{}. Y{}. F600\n", n * 7 % 60, n % 40)
        })
        .named("oscillation", 200)
        .vibrating()
    },
    on("five-axis", &["five-axis-mill.toml"], FIVE_AXES, "G49\nM30\n", |n| {
        format!("G1 X{}. Y{}. A-{}. C{}. F2000\n", n % 50, n * 3 % 40, 10 + n % 20, n % 30)
    })
    .named("tool centre point", 1_000),
    on("five-axis", &["five-axis-mill.toml"], FIVE_AXES, "M34\nG49\nM30\n", |n| {
        format!("M33\nG1 X{}.{} Y0 A-{}. C{}. F2000\n", n / 10 % 50, n % 10, 10 + n / 10 % 20, n / 10 % 30)
    })
    .named("thinning", 1_000),
    lathe("vibration along the path", 500, |n| {
        format!("G200 F{} A0.03\nG1 X{}. Z-{}. F0.05\nG201\n", 35 + n % 4, 50 + n % 40, n % 20)
    })
    .vibrating(),
    on("turning", &["posts/lathe-a.toml"], LATHE_A, "M30\n", |n| {
        format!("G0 X40. Z5.\nG165 P3 X40. Q1.2\nG92 X39.5 Z-{}. F1.5\nX39.2\nX39.\nG165 P0\n", 20 + n % 3)
    })
    .named("vibrating threads", 20)
    .vibrating(),
    on("turning", &["posts/lathe-a.toml"], LATHE_A, "M30\n", |n| {
        let (first, last) = (2 * n + 10, 2 * n + 11);
        format!(
            "G0 X62. Z2.\nG71 U2. R0.5\nG71 P{first} Q{last} U0.5 W0.1 F0.3\nN{first} G0 X20.\nG1 Z-10.\nX40. Z-20.\nN{last} X62.\n\
             G70 P{first} Q{last}\n"
        )
    })
    .named("roughing cycles", 100),
    on("turning", &["posts/lathe-a.toml"], LATHE_A, "M30\n", |n| {
        format!("G0 X40. Z5.\nG76 P010060 Q100 R0.05\nG76 X38.16 Z-{}. P920 Q300 F1.5\n", 20 + n % 3)
    })
    .named("threading cycles", 50),
    lathe("constant surface speed", 2_000, |n| format!("G96 S200\nG1 X{}. F0.2\nG97 S800\n", 40 + n % 50)),
];

const fn of(name: &'static str, head: &'static str, count: u64, body: fn(u64) -> String) -> Construct {
    Construct {
        name,
        machine: "machines/mill",
        files: &[],
        tools: &[],
        head,
        body,
        tail: "M30\n",
        count,
        period_us: PERIOD_US,
        state: JobState::Ready,
    }
}

const fn lathe(name: &'static str, count: u64, body: fn(u64) -> String) -> Construct {
    Construct { machine: "machines/lathe", ..of(name, LATHE, count, body) }
}

/// On a machine of its own, which is made from `files`.
const fn on(
    machine: &'static str,
    files: &'static [&'static str],
    head: &'static str,
    tail: &'static str,
    body: fn(u64) -> String,
) -> Construct {
    Construct { machine, files, tail, ..of("", head, 0, body) }
}

impl Construct {
    const fn named(self, name: &'static str, count: u64) -> Self {
        Self { name, count, ..self }
    }

    const fn vibrating(self) -> Self {
        Self { period_us: VIBRATING_PERIOD_US, ..self }
    }

    const fn refused(self) -> Self {
        Self { state: JobState::Rejected, ..self }
    }

    /// Gives the service machine and tools; the name of the machine.
    async fn set_up(&self, server: &Server) -> String {
        for file in self.files {
            let path = format!("{}/../../tests/fixtures/{file}", env!("CARGO_MANIFEST_DIR"));
            let tools = file.ends_with("-tools.toml");
            let mut command = Command::new(FEEDWAVE);
            command.args([if tools { "tool" } else { "machine" }, "put", &path]);
            command.args((!tools).then_some(self.machine)).args(["--server", &format!("http://{}", server.grpc)]);
            let output = command.output().await.expect("the command runs");
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        }
        if self.files.is_empty() { self.machine.to_owned() } else { format!("machines/{}", self.machine) }
    }

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
    let machine = construct.set_up(&server).await;
    let program = upload(&mut clients, &construct.program(times)).await.expect("the upload is taken");
    let before = cpu_s(server.pid());
    let request = CreateJobRequest {
        machine,
        source: Some(Source::Program(program)),
        interpolation_period_us: construct.period_us,
        tools: construct.tools.iter().map(ToString::to_string).collect(),
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
        if taken.iter().any(|taken| taken.state != construct.state) {
            failed.push(format!("{}: {:?}", construct.name, taken[2].state));
        }
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
