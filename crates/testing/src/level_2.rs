//! Level-2 files of HRSC: a PDS3 label, and rows with their times.

/// An image of one exposure time, 8 bits a sample.
#[derive(Debug, Clone, Copy)]
pub struct Level2<'a> {
    /// Orbit and image in the name of the product: `H5270_0000`.
    pub orbit: &'a str,
    /// Line in the name of the product, `S1`, and in the label, `MEX_HRSC_S1`.
    pub line: [&'a str; 2],
    /// UTC of the first line.
    pub utc_start: &'a str,
    /// Start of the first line, ET seconds.
    pub start_et_s: f64,
    /// Milliseconds from line to line.
    pub period_ms: f32,
    /// Detector lines and pixels summed.
    pub macro_pixel: u32,
    /// Lines and samples.
    pub size: [u32; 2],
}

impl Level2<'_> {
    const PREFIX_BYTES: u32 = 68;

    /// Bytes of the file with these samples.
    pub fn file(&self, sample: impl Fn(u32, u32) -> u8) -> Vec<u8> {
        let [lines, samples] = self.size;
        let record = Self::PREFIX_BYTES + samples;
        let text = self.label(record, 0);
        let label_records = u32::try_from(text.len() + 100).unwrap().div_ceil(record);
        let mut bytes = self.label(record, label_records).into_bytes();
        bytes.resize((label_records * record) as usize, b' ');
        for line in 0..lines {
            let after_s = f64::from(line) * f64::from(self.period_ms) * 1e-3;
            bytes.extend((self.start_et_s + after_s).to_le_bytes());
            bytes.extend(self.period_ms.to_le_bytes());
            bytes.extend([7; 56]);
            bytes.extend((0..samples).map(|at| sample(line, at)));
        }
        bytes
    }

    fn label(&self, record: u32, label_records: u32) -> String {
        let [lines, samples] = self.size;
        let Self {
            orbit,
            line: [short, detector],
            utc_start,
            macro_pixel,
            ..
        } = self;
        format!(
            "PDS_VERSION_ID = PDS3\r\nRECORD_TYPE = FIXED_LENGTH\r\nRECORD_BYTES = {record}\r\nFILE_RECORDS = {}\r\n\
             LABEL_RECORDS = {label_records}\r\n^IMAGE = {}\r\nFILE_NAME = {orbit}_{short}2.IMG\r\n\
             DETECTOR_ID = {detector}\r\nINSTRUMENT_HOST_NAME = \"MARS EXPRESS\"\r\nINSTRUMENT_ID = HRSC\r\n\
             PROCESSING_LEVEL_ID = 2\r\nPRODUCT_ID = {orbit}_{short}2.IMG\r\nSTART_TIME = {utc_start}Z\r\n\
             TARGET_NAME = MARS\r\nMACROPIXEL_SIZE = {macro_pixel}\r\nOBJECT = IMAGE\r\nLINES = {lines}\r\n\
             LINE_SAMPLES = {samples}\r\nLINE_PREFIX_BYTES = {}\r\nBANDS = 1\r\nSAMPLE_BITS = 8\r\n\
             SAMPLE_TYPE = UNSIGNED_INTEGER\r\nEND_OBJECT = IMAGE\r\nEND\r\n",
            label_records + lines,
            label_records + 1,
            Self::PREFIX_BYTES,
        )
    }
}
