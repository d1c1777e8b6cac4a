//! The program stopped at its system calls with ptrace(2): a kill hits between two of them, not a moment.

use std::{
    fs::{self, File},
    io::{self, Read as _},
    os::unix::fs::FileExt,
    path::PathBuf,
    process::{Command, Stdio},
};

use libc::{c_int, pid_t};

/// A system call on a file that is about to be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Call {
    pub(crate) name: &'static str,
    pub(crate) path: PathBuf,
}

impl Call {
    /// Whether it changes what is on the disk.
    pub(crate) fn changes(&self) -> bool {
        self.name != "open"
    }
}

/// What happens at a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Then {
    GoOn,
    /// The program is killed; the call is never made.
    Kill,
    /// The program gets this signal, and goes on.
    Signal(c_int),
}

/// How a traced program ended.
#[derive(Debug)]
pub(crate) struct Ended {
    /// Its exit code; none when it was killed.
    pub(crate) code: Option<i32>,
    pub(crate) stderr: String,
}

/// Runs a command and asks `at` at every system call on a file, before it is made.
pub(crate) fn traced(command: &Command, mut at: impl FnMut(&Call) -> Then) -> Ended {
    let mut errors = tempfile::tempfile().unwrap();
    let program = stopped(command, &errors);
    seize(program).unwrap();
    send(program, libc::SIGCONT).unwrap();
    let code = loop {
        // Only what this thread traces: other tests have children of their own.
        let (thread, status) = wait(-1, libc::__WALL | libc::__WNOTHREAD).unwrap();
        if !libc::WIFSTOPPED(status) {
            if thread != program {
                continue;
            }
            break libc::WIFEXITED(status).then(|| libc::WEXITSTATUS(status));
        }
        let signal = libc::WSTOPSIG(status);
        // An event of ptrace stands behind the signal.
        let pass_on = match signal {
            SYSTEM_CALL => {
                let then = call_of(thread).map_or(Then::GoOn, |call| at(&call));
                match then {
                    Then::GoOn => {}
                    Then::Kill => send(program, libc::SIGKILL).unwrap(),
                    Then::Signal(signal) => send(program, signal).unwrap(),
                }
                0
            }
            _ if status >> 16 != 0 => 0,
            signal => signal,
        };
        match go_on(thread, pass_on) {
            // A thread that was killed meanwhile.
            Err(error) if error.raw_os_error() == Some(libc::ESRCH) => {}
            outcome => outcome.unwrap(),
        }
    };
    let mut stderr = String::new();
    io::Seek::rewind(&mut errors).unwrap();
    errors.read_to_string(&mut stderr).unwrap();
    Ended { code, stderr }
}

/// How a stop at a system call is told apart from a trap (`PTRACE_O_TRACESYSGOOD`).
const SYSTEM_CALL: c_int = libc::SIGTRAP | 0x80;

/// Traces a process, and all threads that it will have; they end with the test.
#[allow(
    unsafe_code,
    reason = "no safe form of ptrace without another set of features of libc"
)]
fn seize(program: pid_t) -> io::Result<()> {
    let options = libc::PTRACE_O_TRACESYSGOOD
        | libc::PTRACE_O_TRACECLONE
        | libc::PTRACE_O_TRACEFORK
        | libc::PTRACE_O_TRACEVFORK
        | libc::PTRACE_O_TRACEEXEC
        | libc::PTRACE_O_EXITKILL;
    // SAFETY: this request reads no memory of ours.
    checked(unsafe { libc::ptrace(libc::PTRACE_SEIZE, program, 0, options) })
}

/// Lets a stopped thread go on to its next system call, with a signal unless that is 0.
#[allow(unsafe_code, reason = "as above")]
fn go_on(thread: pid_t, signal: c_int) -> io::Result<()> {
    // SAFETY: this request reads no memory of ours.
    checked(unsafe { libc::ptrace(libc::PTRACE_SYSCALL, thread, 0, signal) })
}

#[allow(unsafe_code, reason = "as above")]
fn registers_of(thread: pid_t) -> Option<libc::user_regs_struct> {
    let mut registers = std::mem::MaybeUninit::zeroed();
    let to = registers.as_mut_ptr();
    // SAFETY: the request writes one structure of this type, for which all zeros are valid.
    unsafe {
        checked(libc::ptrace(libc::PTRACE_GETREGS, thread, 0, to)).ok()?;
        Some(registers.assume_init())
    }
}

#[allow(unsafe_code, reason = "as above")]
fn send(process: pid_t, signal: c_int) -> io::Result<()> {
    // SAFETY: no memory is touched.
    checked(i64::from(unsafe { libc::kill(process, signal) }))
}

/// The next process or thread that changed its state, and its status.
#[allow(unsafe_code, reason = "as above")]
fn wait(process: pid_t, flags: c_int) -> io::Result<(pid_t, c_int)> {
    let mut status = 0;
    loop {
        // SAFETY: `status` is a live integer.
        let found = unsafe { libc::waitpid(process, &raw mut status, flags) };
        match checked(i64::from(found)) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            outcome => return outcome.map(|()| (found, status)),
        }
    }
}

fn checked(outcome: libc::c_long) -> io::Result<()> {
    if outcome < 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(())
}

/// Starts the command in a shell that stops before it becomes the program.
#[allow(clippy::zombie_processes, reason = "`traced` waits for it")]
fn stopped(command: &Command, errors: &File) -> pid_t {
    let mut shell = Command::new("sh");
    shell
        .args(["-c", "kill -STOP $$; exec \"$0\" \"$@\""])
        .arg(command.get_program())
        .args(command.get_args())
        .stdout(Stdio::null())
        .stderr(errors.try_clone().unwrap());
    if let Some(folder) = command.get_current_dir() {
        shell.current_dir(folder);
    }
    let child = shell.spawn().unwrap();
    let process = child.id().try_into().unwrap();
    let (_, status) = wait(process, libc::WUNTRACED).unwrap();
    assert!(libc::WIFSTOPPED(status), "the shell ended with {status}");
    process
}

/// The call that a thread is about to make, if it is one on a file.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "registers hold integers of C"
)]
fn call_of(thread: pid_t) -> Option<Call> {
    let registers = registers_of(thread)?;
    // So the kernel marks a call that is not made yet.
    if registers.rax.cast_signed() != -i64::from(libc::ENOSYS) {
        return None;
    }
    let descriptor = registers.rdi;
    let open = |flags: u64| {
        let writes = libc::O_WRONLY | libc::O_RDWR | libc::O_CREAT | libc::O_TRUNC;
        let writes = u64::from(writes.cast_unsigned());
        if flags & writes == 0 {
            "open"
        } else {
            "create"
        }
    };
    let here = libc::AT_FDCWD as u64;
    let call = libc::c_long::try_from(registers.orig_rax).ok()?;
    let (name, folder, path) = match call {
        libc::SYS_open => (open(registers.rsi), here, registers.rdi),
        libc::SYS_openat => (open(registers.rdx), registers.rdi, registers.rsi),
        libc::SYS_rename | libc::SYS_link => ("rename", here, registers.rsi),
        libc::SYS_renameat | libc::SYS_renameat2 | libc::SYS_linkat => {
            ("rename", registers.rdx, registers.r10)
        }
        libc::SYS_unlink | libc::SYS_rmdir => ("remove", here, registers.rdi),
        libc::SYS_unlinkat => ("remove", registers.rdi, registers.rsi),
        libc::SYS_mkdir => ("mkdir", here, registers.rdi),
        libc::SYS_mkdirat => ("mkdir", registers.rdi, registers.rsi),
        libc::SYS_write | libc::SYS_pwrite64 | libc::SYS_writev | libc::SYS_ftruncate => {
            return of_descriptor(thread, "write", descriptor);
        }
        libc::SYS_fsync | libc::SYS_fdatasync => {
            return of_descriptor(thread, "flush", descriptor);
        }
        _ => return None,
    };
    let path = PathBuf::from(text_at(thread, path)?);
    let folder = if folder as i32 == libc::AT_FDCWD {
        fs::read_link(format!("/proc/{thread}/cwd")).ok()?
    } else {
        fs::read_link(format!("/proc/{thread}/fd/{}", folder as i32)).ok()?
    };
    let path = folder.join(path);
    Some(Call { name, path })
}

fn of_descriptor(thread: pid_t, name: &'static str, descriptor: u64) -> Option<Call> {
    let path = fs::read_link(format!("/proc/{thread}/fd/{descriptor}")).ok()?;
    Some(Call { name, path })
}

/// A text in the memory of a stopped thread, up to its closing zero.
fn text_at(thread: pid_t, mut address: u64) -> Option<String> {
    let memory = File::open(format!("/proc/{thread}/mem")).ok()?;
    let mut text = Vec::new();
    loop {
        let mut byte = [0];
        memory.read_exact_at(&mut byte, address).ok()?;
        if byte[0] == 0 {
            return String::from_utf8(text).ok();
        }
        text.push(byte[0]);
        address += 1;
    }
}
