//! A serial port of the system: one that comes back under another name, and one that cannot be opened.

use serialport::{SerialPortInfo, SerialPortType};
use std::io::{self, ErrorKind};
use std::path::Path;

/// A port by its name, and by the serial number of its USB device once that is known.
pub struct UsbPort {
    path: String,
    serial: Option<String>,
}

impl UsbPort {
    /// A port as a person names it.
    pub fn new(path: &str) -> Self {
        Self {
            path: path.to_owned(),
            serial: None,
        }
    }

    /// Where the port is now: a device that was plugged in again may have another number.
    pub fn path(&mut self) -> String {
        // A system that does not list its ports has them under the names that they had.
        let ports = serialport::available_ports().unwrap_or_default();
        self.path_among(&ports)
    }

    fn path_among(&mut self, ports: &[SerialPortInfo]) -> String {
        // Names like those in /dev/serial/by-id are links.
        let real = std::fs::canonicalize(&self.path);
        let real = real.map_or(self.path.clone(), |path| {
            path.to_string_lossy().into_owned()
        });
        let here = ports
            .iter()
            .find(|p| p.port_name == real || p.port_name == self.path);
        let Some(serial) = &self.serial else {
            self.serial = here.and_then(serial_of).map(str::to_owned);
            return self.path.clone();
        };
        if here.and_then(serial_of) == Some(serial) {
            return self.path.clone();
        }
        let elsewhere = ports.iter().find(|p| serial_of(p) == Some(serial));
        elsewhere.map_or(self.path.clone(), |port| port.port_name.clone())
    }
}

fn serial_of(port: &SerialPortInfo) -> Option<&str> {
    match &port.port_type {
        SerialPortType::UsbPort(usb) => usb.serial_number.as_deref(),
        _ => None,
    }
}

/// What to do about a port that cannot be opened.
pub fn remedy_for(port: &str, error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::PermissionDenied => match group_of(Path::new(port)) {
            Some(group) => format!(
                "this user may not: join the group {group} (sudo usermod -aG {group} $USER), and log in again"
            ),
            None => "this user may not: check its permissions".into(),
        },
        ErrorKind::NotFound => {
            let ports = serialport::available_ports().unwrap_or_default();
            let names: Vec<String> = ports.into_iter().map(|port| port.port_name).collect();
            match names.is_empty() {
                true => "there is no such port, nor any other: check cable and power".into(),
                false => format!("there is no such port: there are {}", names.join(", ")),
            }
        }
        _ => "check the cable, the name and that nobody else uses it".into(),
    }
}

/// The group whose members may use a file.
#[cfg(unix)]
fn group_of(path: &Path) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    let gid = std::fs::metadata(path).ok()?.gid();
    group_named(&std::fs::read_to_string("/etc/group").ok()?, gid)
}

#[cfg(not(unix))]
fn group_of(_: &Path) -> Option<String> {
    None
}

/// The name of a group in the text of `/etc/group`.
#[cfg(unix)]
fn group_named(groups: &str, gid: u32) -> Option<String> {
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let (name, number) = (fields.next()?, fields.nth(1)?);
        (number.parse() == Ok(gid)).then(|| name.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::UsbPortInfo;

    fn port(name: &str, serial: Option<&str>) -> SerialPortInfo {
        SerialPortInfo {
            port_name: name.into(),
            port_type: SerialPortType::UsbPort(UsbPortInfo {
                vid: 0x0483,
                pid: 0x374b,
                serial_number: serial.map(str::to_owned),
                manufacturer: None,
                product: None,
            }),
        }
    }

    #[test]
    fn a_device_that_comes_back_under_another_number_is_found_by_its_serial_number() {
        let mut light = UsbPort::new("/dev/ttyACM-none-0");
        let before = [
            port("/dev/ttyACM-none-0", Some("A")),
            port("/dev/ttyACM-none-1", Some("B")),
        ];
        assert_eq!(light.path_among(&before), "/dev/ttyACM-none-0");
        // Both came back, the other way round.
        let after = [
            port("/dev/ttyACM-none-0", Some("B")),
            port("/dev/ttyACM-none-2", Some("A")),
        ];
        assert_eq!(light.path_among(&after), "/dev/ttyACM-none-2");
        // It is away, or the system tells no serial numbers.
        assert_eq!(light.path_among(&[]), "/dev/ttyACM-none-0");
        let mut other = UsbPort::new("/dev/pts/7");
        assert_eq!(other.path_among(&before), "/dev/pts/7");
        assert_eq!(other.path_among(&after), "/dev/pts/7");
    }

    #[cfg(unix)]
    #[test]
    fn a_port_that_this_user_may_not_use_names_the_group_to_join() {
        let groups = "root:x:0:\ndialout:x:20:anna\nusers:x:100:\n";
        assert_eq!(group_named(groups, 20).as_deref(), Some("dialout"));
        assert_eq!(group_named(groups, 21), None);
        let denied = remedy_for("/", &ErrorKind::PermissionDenied.into());
        assert!(denied.contains("join the group root"), "{denied}");
        let none = remedy_for("/dev/none", &ErrorKind::NotFound.into());
        assert!(none.contains("there is no such port"), "{none}");
        let busy = remedy_for("/dev/none", &ErrorKind::ResourceBusy.into());
        assert!(busy.contains("nobody else uses it"), "{busy}");
    }
}
