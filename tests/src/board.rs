//! Boards in QEMU: the built firmware, and what it is run with.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant as Clock};

use companion::Link as Port;
use companion::services::ftp::DATA;
use companion::storage::store::window::Taken;
use companion::storage::store::{Erasing, File, READ, Store, UploadState, WORD};
use host_sim::flash::{DeskFlash, LAYOUT};
use host_sim::link::{Link, LinkUrl};
use object::{Object, ObjectSymbol, Symbol};
use planner_core::voxel::VoxelGrid;

use crate::debugger::Debugger;
use crate::{Guard, free_port, workspace};

/// Where bank 2 of the emulated flash lies.
const BANK2: u32 = 0x6000_0000;
/// Where a byte for each of its words tells what happened to that last: nothing since it was erased, or it was programmed, or
/// it is being programmed or erased.
const MARKS: u32 = 0x6020_0000;
const ERASED: u8 = 0;
const WHOLE: u8 = 1;
const TORN: u8 = 2;
/// Where it is noted that the bank holds something.
const MADE: (u32, u32) = (0x6030_0000, 0x464c_4153);
/// A loaded machine starts nothing at once.
const PATIENCE: Duration = Duration::from_secs(30);
/// What QEMU's monitor says when it waits for an order.
const PROMPT: &[u8] = b"(qemu) ";
/// Where a map for measurements lies.
const MAP: u32 = 0x6080_0000;

/// An address of no memory.
const NOWHERE: u32 = 0xF000_0000;
/// The far end of the stack, which nothing reaches.
const SPARE: u32 = 0x2008_A000;
/// `cpsid i`, then a branch to itself.
const SPIN: [u8; 4] = [0x72, 0xB6, 0xFE, 0xE7];
/// So many instructions later a panic has turned the interrupts off.
const TO_PANIC: usize = 200;
/// In the name of a function of `core` that does nothing but panic, at a place of its own.
const PANICS: &str = "smallsort22panic_on_ord_violation";
/// In the name of the function that makes a plan on a board.
const PLANS: &str = "Planner4plan";
/// An instruction that there is not.
const UNDEFINED: [u8; 2] = [0x00, 0xDE];
/// Less than an interrupt takes of a stack.
const STACK_LEFT: u32 = 8;

/// A program for the board `qemu`, from the directory that `FLOCKMATE_FIRMWARE` names, as seen from the checkout; `None` with a line
/// that says what is skipped.
pub fn program(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("FLOCKMATE_FIRMWARE") else {
        println!("skipped: FLOCKMATE_FIRMWARE names no built firmware (`cargo xtask test` builds it)");
        return None;
    };
    Some(workspace().join(folder).join(name))
}

/// QEMU with a program on the board.
fn qemu(program: &Path) -> Command {
    let mut command = Command::new("qemu-system-arm");
    command
        .args(["-machine", "mps2-an500", "-display", "none"])
        // It would bite where this machine stands still. What hangs by itself does so for good without it, and fails the test.
        .args(["-action", "watchdog=none"])
        .arg("-kernel")
        .arg(program)
        .stdin(Stdio::null());
    command
}

/// What brings a board down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Downfall {
    /// Somebody presses reset.
    Reset,
    /// The processor runs where nothing is.
    Fault,
    /// The program finds itself wrong.
    Panic,
    /// The program goes nowhere, and hears no interrupt.
    Hang,
    /// The stack is as full as can be: what comes next reaches into the guard below it.
    Overflow,
}

impl Downfall {
    /// All there are.
    pub const ALL: [Self; 5] = [Self::Reset, Self::Fault, Self::Panic, Self::Hang, Self::Overflow];

    /// How what the next start says of it begins.
    pub fn said(self) -> &'static str {
        match self {
            Self::Reset | Self::Hang => "Restarted: watchdog, reset key or brown-out",
            Self::Fault => "Restarted: fault at 0xf0000000",
            Self::Panic => "Restarted: panic at smallsort.rs:",
            Self::Overflow => "Restarted: stack overflow",
        }
    }
}

/// A board in QEMU that runs the firmware; it ends with us.
pub struct Emulated {
    monitor: TcpStream,
    program: PathBuf,
    /// TCP port of QEMU's stub for debuggers.
    stub: u16,
    /// TCP ports of its UARTs: to the autopilot, to the radio.
    ports: [u16; 2],
    scratch: tempfile::TempDir,
    _qemu: Guard,
}

impl Emulated {
    /// Switches it on, with what `bank` says in its flash at every reset; else it is empty and keeps what comes. It runs as fast as this machine, or with `shift` so that an instruction
    /// takes 2^`shift` nanoseconds of its time, which is never ahead of the clock.
    ///
    /// # Panics
    /// QEMU does not start.
    pub fn start(program: &Path, shift: Option<u32>, bank: Option<&[u8]>) -> Self {
        let scratch = tempfile::tempdir().expect("a temporary directory");
        let [autopilot, radio, monitor, stub] = [(); 4].map(|()| free_port());
        let ports = [autopilot, radio];
        let listen = |port: u16| format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on");
        let mut qemu = qemu(program);
        qemu.args(["-monitor", &listen(monitor), "-serial", &listen(autopilot), "-serial", &listen(radio)])
            .args(["-gdb", &format!("tcp:127.0.0.1:{stub}")])
            .args(["-semihosting-config", "enable=on,target=native,chardev=log"])
            .args(["-chardev", &format!("file,id=log,path={}", scratch.path().join("log").display())]);
        if let Some(shift) = shift {
            qemu.args(["-icount", &format!("shift={shift}")]);
        }
        if let Some(bank) = bank {
            let mark = |word: &[u8]| if word.iter().all(|byte| *byte == 0xFF) { ERASED } else { WHOLE };
            let marks: Vec<u8> = bank.chunks(WORD).map(mark).collect();
            for (name, bytes, at) in
                [("bank", bank, BANK2), ("marks", &marks, MARKS), ("made", &MADE.1.to_le_bytes(), MADE.0)]
            {
                let file = scratch.path().join(name);
                std::fs::write(&file, bytes).expect("it can be written");
                qemu.args(["-device", &loader(&file, at)]);
            }
        }
        let qemu = Guard(qemu.stdout(Stdio::null()).spawn().expect("qemu-system-arm starts"));
        let monitor = connect(monitor);
        let mut board = Self { monitor, program: program.to_owned(), stub, ports, scratch, _qemu: qemu };
        board.answer();
        board
    }

    /// Plugs a cable into one of its ports, once the one before is gone.
    ///
    /// # Panics
    /// The port is not there.
    pub fn plug(&self, port: Port) -> Box<dyn Link> {
        let url = LinkUrl::Tcp(format!("127.0.0.1:{}", self.ports[port as usize]));
        url.open().expect("the board's port is open")
    }

    /// Presses reset; the flash keeps what it holds, torn words too.
    pub fn reset(&mut self) {
        self.order("system_reset");
    }

    /// Brings it down; the flash keeps what it holds, torn words too. It is to start again by itself.
    ///
    /// # Panics
    /// The program has no function that panics by itself.
    pub fn bring_down(&mut self, how: Downfall) {
        match how {
            Downfall::Reset => self.reset(),
            Downfall::Fault => self.jump(NOWHERE, 1),
            Downfall::Panic => self.jump(self.function(PANICS), TO_PANIC),
            Downfall::Hang => {
                self.order("watchdog_action reset");
                let mut debugger = Debugger::new(connect(self.stub));
                debugger.write(SPARE, &SPIN);
                debugger.jump(SPARE, 1);
                debugger.leave();
            }
            Downfall::Overflow => {
                let mut debugger = Debugger::new(connect(self.stub));
                debugger.set_stack(SPARE + STACK_LEFT);
                debugger.leave();
            }
        }
    }

    /// Has its planner fault whenever it plans, until the next start.
    ///
    /// # Panics
    /// The program has no planner.
    pub fn break_planner(&mut self) {
        self.halt(true);
        let mut debugger = Debugger::new(connect(self.stub));
        debugger.write(self.function(PLANS), &UNDEFINED);
        debugger.leave();
        self.halt(false);
    }

    /// The address of the function whose name contains this.
    fn function(&self, part: &str) -> u32 {
        let bytes = std::fs::read(&self.program).expect("it was started");
        let elf = object::File::parse(&*bytes).expect("a program");
        let named = |symbol: &Symbol<'_, '_>| symbol.name().is_ok_and(|name| name.contains(part));
        let symbol =
            elf.symbols().find(named).unwrap_or_else(|| panic!("no function has {part} in its name"));
        symbol.address() as u32 & !1
    }

    fn jump(&self, address: u32, instructions: usize) {
        let mut debugger = Debugger::new(connect(self.stub));
        debugger.jump(address, instructions);
        debugger.leave();
    }

    /// Halts the board where it is, or lets it run on.
    pub fn halt(&mut self, halted: bool) {
        self.order(if halted { "stop" } else { "cont" });
    }

    /// Words of its flash that are being programmed or erased, in its order. It should be halted.
    ///
    /// # Panics
    /// QEMU gives no memory.
    pub fn torn(&mut self) -> Vec<usize> {
        let marks = self.memory(MARKS, LAYOUT.len() as usize / WORD);
        (0..marks.len()).filter(|word| marks[*word] == TORN).collect()
    }

    /// Its memory from an address on.
    fn memory(&mut self, address: u32, length: usize) -> Vec<u8> {
        let file = self.scratch.path().join("memory");
        self.order(&format!("pmemsave {address} {length} \"{}\"", file.display()));
        let bytes = std::fs::read(file).expect("QEMU wrote it");
        assert_eq!(bytes.len(), length);
        bytes
    }

    /// Has QEMU's monitor do something.
    fn order(&mut self, line: &str) {
        writeln!(self.monitor, "{line}").expect("QEMU listens");
        self.answer();
    }

    fn answer(&mut self) {
        let mut heard = Vec::new();
        let mut buffer = [0; 4096];
        // The line is echoed before it is obeyed, and the prompt comes after.
        while !heard.ends_with(PROMPT) {
            let length = self.monitor.read(&mut buffer).expect("QEMU answers");
            assert!(length > 0, "QEMU ended: {}", String::from_utf8_lossy(&heard));
            heard.extend_from_slice(&buffer[..length]);
        }
    }
}

/// What a bank of flash holds after these files were uploaded to an empty one, its other slot erased.
///
/// # Panics
/// A file is refused.
pub fn bank(roadmap: &[u8], mission: &[u8]) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let file = folder.path().join("bank");
    let mut flash = DeskFlash::open(Some(&file)).expect("it can be made");
    let mut store = Store::mount(LAYOUT, &mut flash);
    let mut settle = |store: &mut Store| {
        let mut read = [0; READ];
        while let Some(request) = store.poll(Erasing::Allowed) {
            let outcome = flash.obey(request, &mut read);
            store.handle(outcome);
        }
    };
    settle(&mut store);
    for (file, bytes) in [(File::Roadmap, roadmap), (File::Mission, mission)] {
        store.open(file, Erasing::Allowed).expect("an idle store takes uploads");
        settle(&mut store);
        for (i, piece) in bytes.chunks(DATA).enumerate() {
            assert_eq!(store.take((i * DATA) as u32, piece), Taken::Yes);
            settle(&mut store);
        }
        store.close();
        settle(&mut store);
        assert_eq!(store.upload(), Some(UploadState::Ended(Ok(()))));
    }
    std::fs::read(&file).expect("it was written")
}

/// QEMU's option that puts a file into memory at every reset.
fn loader(file: &Path, at: u32) -> String {
    format!("loader,file={},addr={at:#x},force-raw=on", file.display())
}

/// Connects to what is about to listen.
fn connect(port: u16) -> TcpStream {
    let began = Clock::now();
    loop {
        match TcpStream::connect(("127.0.0.1", port)) {
            Ok(stream) => {
                stream.set_read_timeout(Some(PATIENCE)).expect("a timeout can be set");
                return stream;
            }
            Err(error) => assert!(began.elapsed() < PATIENCE, "QEMU does not listen: {error}"),
        }
        sleep(Duration::from_millis(20));
    }
}

/// A map as `measure` and `calls` find it.
pub fn map_image(grid: &VoxelGrid<'_>) -> Vec<u8> {
    let shape = grid.shape();
    let dims = shape.dims.iter().flat_map(|d| d.to_le_bytes());
    let numbers = shape.min.iter().chain([&shape.resolution_m]).flat_map(|x| x.to_le_bytes());
    let words = grid.words();
    let count = (words.len() as u32).to_le_bytes();
    dims.chain(numbers).chain(count).chain(words.iter().flat_map(|word| word.to_le_bytes())).collect()
}

/// What `measure` or `calls` says of a roadmap file and a map, line by line.
///
/// # Panics
/// It does not run to its end.
pub fn measure(program: &Path, roadmap: &[u8], map: &[u8]) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let file = |name: &str, bytes: &[u8]| {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).expect("it can be written");
        file
    };
    let (roadmap, map) = (file("roadmap.bin", roadmap), file("map.bin", map));
    // An instruction takes a nanosecond of the board's time.
    let out = qemu(program)
        .args(["-monitor", "none", "-icount", "shift=0", "-semihosting-config", "enable=on,target=native"])
        .args(["-device", &loader(&roadmap, BANK2), "-device", &loader(&map, MAP)])
        .output()
        .expect("qemu-system-arm runs");
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success(), "{text}\n{}", String::from_utf8_lossy(&out.stderr));
    text.lines().map(str::to_owned).collect()
}
