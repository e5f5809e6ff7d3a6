//! The simulated device's registers, and the GenICam description of them.

use gonia_rig::PixelFormat;
use std::fmt::Write;

/// Where the device keeps what it is set to. Those up to `Line` are where aravis' device looks for
/// them.
#[derive(Clone, Copy)]
#[repr(u32)]
pub enum Register {
    Width = 0x100,
    Height = 0x104,
    SensorHeight = 0x118,
    SensorWidth = 0x11c,
    ExposureTime = 0x120,
    Acquisition = 0x124,
    PixelFormat = 0x128,
    AcquisitionMode = 0x12c,
    OffsetX = 0x130,
    OffsetY = 0x134,
    TriggerMode = 0x300,
    TriggerSource = 0x304,
    /// High while there is a pulse that was not seen.
    Line = 0x30c,
    ExposureMode = 0x400,
}

/// Value of ExposureMode.
pub const TRIGGER_WIDTH: u32 = 1;
/// The value of TriggerSource at which aravis' device looks at `Register::Line`.
const LINE_1: u32 = 1;

/// Names and numbers of the Pixel Format Naming Convention.
const FORMATS: [(&str, u32); 19] = [
    ("Mono8", 0x0108_0001),
    ("Mono12", 0x0110_0005),
    ("Mono10Packed", 0x010c_0004),
    ("Mono12Packed", 0x010c_0006),
    ("Mono16", 0x0110_0007),
    ("BayerGR8", 0x0108_0008),
    ("BayerRG8", 0x0108_0009),
    ("BayerGB8", 0x0108_000A),
    ("BayerBG8", 0x0108_000B),
    ("BayerGR12", 0x0110_0010),
    ("BayerRG12", 0x0110_0011),
    ("BayerGB12", 0x0110_0012),
    ("BayerBG12", 0x0110_0013),
    ("BayerRG12Packed", 0x010c_002b),
    ("BayerBG12p", 0x010c_0053),
    ("BayerGB12p", 0x010c_0055),
    ("BayerGR12p", 0x010c_0057),
    ("BayerRG12p", 0x010c_0059),
    ("BayerRG10p", 0x010a_0058),
];

/// The format of a number.
pub fn format_of(code: u32) -> Option<PixelFormat> {
    let (name, _) = FORMATS.iter().find(|format| format.1 == code)?;
    PixelFormat::named(name)
}

/// The description.
pub fn xml() -> String {
    let mut features = Features::default();
    for (name, address, length) in [
        ("DeviceVendorName", 0x48, 32),
        ("DeviceModelName", 0x68, 32),
        ("DeviceVersion", 0x88, 32),
        ("DeviceSerialNumber", 0xd8, 16),
    ] {
        features.text(name, address, length);
    }
    for (name, register, bounds) in [
        ("SensorWidth", Register::SensorWidth, ["<Min>1</Min>", ""]),
        ("SensorHeight", Register::SensorHeight, ["<Min>1</Min>", ""]),
        (
            "Width",
            Register::Width,
            ["<Min>1</Min>", "<pMax>SensorWidth</pMax>"],
        ),
        (
            "Height",
            Register::Height,
            ["<Min>1</Min>", "<pMax>SensorHeight</pMax>"],
        ),
        (
            "OffsetX",
            Register::OffsetX,
            ["<Min>0</Min>", "<pMax>SensorWidth</pMax>"],
        ),
        (
            "OffsetY",
            Register::OffsetY,
            ["<Min>0</Min>", "<pMax>SensorHeight</pMax>"],
        ),
    ] {
        features.integer(name, register, &bounds.concat());
    }
    features.choice("PixelFormat", Register::PixelFormat, &FORMATS);
    features.choice(
        "AcquisitionMode",
        Register::AcquisitionMode,
        &[("Continuous", 1)],
    );
    features.command("AcquisitionStart", 1);
    features.command("AcquisitionStop", 0);
    features.register("Acquisition", Register::Acquisition);
    features.add(
        "Enumeration",
        "TriggerSelector",
        "<EnumEntry Name=\"FrameStart\"><Value>0</Value></EnumEntry><Value>0</Value>",
    );
    features.choice(
        "TriggerMode",
        Register::TriggerMode,
        &[("Off", 0), ("On", 1)],
    );
    features.choice(
        "TriggerSource",
        Register::TriggerSource,
        &[("Line1", LINE_1)],
    );
    let modes = [("Timed", 0), ("TriggerWidth", TRIGGER_WIDTH)];
    features.choice("ExposureMode", Register::ExposureMode, &modes);
    features.add(
        "Float",
        "ExposureTime",
        "<pValue>ExposureTimeConverter</pValue><Min>10</Min><Max>600000000</Max>",
    );
    features.add("Converter", "ExposureTimeConverter", "<FormulaTo>FROM</FormulaTo><FormulaFrom>TO</FormulaFrom><pValue>ExposureTimeRegister</pValue>");
    features.register("ExposureTime", Register::ExposureTime);
    features.add("IntSwissKnife", "PayloadSize", "<pVariable Name=\"W\">Width</pVariable><pVariable Name=\"H\">Height</pVariable><pVariable Name=\"F\">PixelFormat</pVariable><Formula>W * H * ((F &gt;&gt; 16) &amp; 0xFF) / 8</Formula>");
    features.add(
        "Integer",
        "TLParamsLocked",
        "<Value>0</Value><Min>0</Min><Max>1</Max>",
    );
    format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<RegisterDescription ModelName=\"Simulated\" VendorName=\"gonia\" StandardNameSpace=\"None\" SchemaMajorVersion=\"1\" SchemaMinorVersion=\"1\" SchemaSubMinorVersion=\"0\" MajorVersion=\"1\" MinorVersion=\"0\" SubMinorVersion=\"0\" ToolTip=\"\" ProductGuid=\"0\" VersionGuid=\"0\" xmlns=\"http://www.genicam.org/GenApi/Version_1_1\">\n<Category Name=\"Root\">{}</Category>\n{}<Port Name=\"Device\"></Port>\n</RegisterDescription>\n",
        features.listed, features.nodes
    )
}

#[derive(Default)]
struct Features {
    listed: String,
    nodes: String,
}

impl Features {
    fn add(&mut self, kind: &str, name: &str, body: &str) {
        // Writing to a string does not fail.
        let _ = writeln!(self.nodes, "<{kind} Name=\"{name}\">{body}</{kind}>");
        if !matches!(kind, "IntReg" | "Converter") {
            let _ = write!(self.listed, "<pFeature>{name}</pFeature>");
        }
    }

    fn text(&mut self, name: &str, address: u32, length: u32) {
        let body = format!(
            "<Address>{address:#x}</Address><Length>{length}</Length><AccessMode>RO</AccessMode><pPort>Device</pPort>"
        );
        self.add("StringReg", name, &body);
    }

    fn register(&mut self, name: &str, register: Register) {
        let body = format!(
            "<Address>{:#x}</Address><Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess>",
            register as u32
        );
        self.add("IntReg", &format!("{name}Register"), &body);
    }

    fn integer(&mut self, name: &str, register: Register, bounds: &str) {
        self.add(
            "Integer",
            name,
            &format!("<pValue>{name}Register</pValue>{bounds}"),
        );
        self.register(name, register);
    }

    fn choice(&mut self, name: &str, register: Register, entries: &[(&str, u32)]) {
        let entries: String = entries
            .iter()
            .map(|(entry, value)| {
                format!("<EnumEntry Name=\"{entry}\"><Value>{value}</Value></EnumEntry>")
            })
            .collect();
        self.add(
            "Enumeration",
            name,
            &format!("{entries}<pValue>{name}Register</pValue>"),
        );
        self.register(name, register);
    }

    fn command(&mut self, name: &str, value: u32) {
        let body =
            format!("<pValue>AcquisitionRegister</pValue><CommandValue>{value}</CommandValue>");
        self.add("Command", name, &body);
    }
}
