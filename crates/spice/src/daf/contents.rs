//! The words of a segment, checked against its own counts.

use super::{
    Reader, Segment,
    layout::{DIRECTORY_STEP, Layout, List, Packet, STATE, layout},
    neighbours::{self, States, Times},
    problem::Problem,
};
use crate::role::KernelRole;

/// Words read at a time.
const CHUNK_WORDS: usize = 1 << 16;
/// Words at the end of a segment that contain its counts.
const TAIL_WORDS: usize = 8;
/// Largest deviation of the mid-point and half length of a record from the values for its position, as a share of its
/// length: above rounding, far below any damage that matters.
const STRETCH_TOLERANCE: f64 = 1e-6;
/// Largest deviation of a quaternion's norm from 1. Quaternions stored in single precision, or digitised in 16 bits on
/// board, stay below it.
const NORM_TOLERANCE: f64 = 5e-4;

/// Reads a segment from its counts to its last packet.
pub(super) fn check(
    reader: &mut Reader,
    role: KernelRole,
    segment: &Segment,
) -> Result<(), Problem> {
    let content = segment.content(role);
    let words = content.words;
    let end = content.first_word + words as u64;
    let tail = words.min(TAIL_WORDS);
    let tail = reader.words(end - tail as u64, tail)?;
    let Some(layout) = layout(role, content.kind, content.rates, words, &tail)? else {
        return Part {
            first_word: content.first_word,
            words,
        }
        .each(reader, 1, |_, _| Ok(()));
    };
    if layout.words() != words {
        return Err(format!(
            "{words} words; its counts account for {} words",
            layout.words()
        )
        .into());
    }
    let mut first_word = content.first_word;
    let packets = Part {
        first_word,
        words: layout.packets * layout.packet.words(),
    };
    let mut norms = Vec::new();
    packets.each(reader, layout.packet.words(), |index, packet| {
        if matches!(layout.packet, Packet::Quaternion(_)) {
            norms.push(norm_of_quaternion(packet));
        }
        check_packet(layout.packet, index, packet)
    })?;
    neighbours::check_norms(&norms)?;
    first_word += packets.words as u64;
    check_lists(reader, &layout, first_word)?;
    if role != KernelRole::Spk || !matches!(layout.packet, Packet::Numbers(STATE)) {
        return Ok(());
    }
    let times = if layout.lists.is_empty() {
        // For equal steps, the third count from the end.
        Times::Every(tail[tail.len() - 3])
    } else {
        Times::Listed(first_word)
    };
    let states = States {
        first_word: content.first_word,
        count: layout.packets,
        times,
    };
    neighbours::check(reader, &states)
}

/// Times increase, and directories repeat every hundredth of them.
fn check_lists(reader: &mut Reader, layout: &Layout, mut first_word: u64) -> Result<(), Problem> {
    let mut hundredths: Vec<Vec<f64>> = Vec::new();
    for list in &layout.lists {
        let mut kept = Vec::new();
        let words = match *list {
            List::Times(words) => {
                let mut last = f64::NEG_INFINITY;
                Part { first_word, words }.each(reader, 1, |index, time| {
                    if time[0] <= last {
                        return Err(format!(
                            "time {} is {:?}, after {last:?}",
                            index + 1,
                            time[0]
                        ));
                    }
                    last = time[0];
                    if (index + 1) % DIRECTORY_STEP == 0 {
                        kept.push(last);
                    }
                    Ok(())
                })?;
                words
            }
            List::Directory { of, entries } => {
                let expected = &hundredths[of];
                Part {
                    first_word,
                    words: entries,
                }
                .each(reader, 1, |index, entry| {
                    let listed = expected.get(index).copied();
                    if listed.is_some_and(|time| time.total_cmp(&entry[0]).is_eq()) {
                        return Ok(());
                    }
                    Err(format!(
                        "entry {} of the time directory is {:?}; expected the time {:?}",
                        index + 1,
                        entry[0],
                        listed.unwrap_or(f64::NAN)
                    ))
                })?;
                entries
            }
        };
        hundredths.push(kept);
        first_word += words as u64;
    }
    Ok(())
}

fn check_packet(packet: Packet, index: usize, words: &[f64]) -> Result<(), String> {
    match packet {
        Packet::Numbers(_) => Ok(()),
        Packet::Differences(lines) => check_differences(index, lines, words),
        Packet::Chebyshev {
            begin_s, length_s, ..
        } => {
            let middle_s = (index as f64 + 0.5).mul_add(length_s, begin_s);
            let off_s = (words[0] - middle_s)
                .abs()
                .max((words[1] - 0.5 * length_s).abs());
            if off_s <= STRETCH_TOLERANCE * length_s {
                return Ok(());
            }
            Err(format!(
                "record {} covers {:?} s about {:?}; expected {:?} s about {middle_s:?}",
                index + 1,
                2.0 * words[1],
                words[0],
                length_s
            ))
        }
        Packet::Quaternion(_) => {
            let norm = norm_of_quaternion(words);
            if (norm - 1.0).abs() <= NORM_TOLERANCE {
                return Ok(());
            }
            Err(format!(
                "quaternion {} has a norm of {norm:?}; expected 1",
                index + 1
            ))
        }
    }
}

/// Norm of the quaternion that a packet begins with.
fn norm_of_quaternion(words: &[f64]) -> f64 {
    let squares = words[..4].iter().map(|part| part * part);
    squares.sum::<f64>().sqrt()
}

/// CSPICE sums as many differences as a record states, and divides by its step sizes.
fn check_differences(index: usize, lines: usize, words: &[f64]) -> Result<(), String> {
    let (step_sizes, counts) = (&words[1..=lines], &words[4 * lines + 7..]);
    let order = super::whole(counts[0]).filter(|order| (2..=lines + 1).contains(order));
    let Some(order) = order else {
        return Err(format!(
            "record {} has an order of {:?}",
            index + 1,
            counts[0]
        ));
    };
    if let Some(of_axis) = counts[1..]
        .iter()
        .find(|count| super::whole(**count).is_none_or(|count| count > lines))
    {
        return Err(format!(
            "record {} has {of_axis:?} differences on an axis",
            index + 1
        ));
    }
    if step_sizes[..order - 2].iter().all(|step| step.abs() > 0.0) {
        return Ok(());
    }
    Err(format!("record {} has a step of 0", index + 1))
}

/// A stretch of words.
struct Part {
    first_word: u64,
    words: usize,
}

impl Part {
    /// Passes each packet of words to `each`, all finite, in order.
    fn each(
        &self,
        reader: &mut Reader,
        packet_words: usize,
        mut show: impl FnMut(usize, &[f64]) -> Result<(), String>,
    ) -> Result<(), Problem> {
        let at_a_time = (CHUNK_WORDS / packet_words).max(1) * packet_words;
        let mut index = 0;
        for from in (0..self.words).step_by(at_a_time) {
            let count = at_a_time.min(self.words - from);
            let words = reader.words(self.first_word + from as u64, count)?;
            for packet in words.chunks_exact(packet_words) {
                if let Some(odd) = packet.iter().find(|word| !word.is_finite()) {
                    return Err(format!("record {} holds {odd}", index + 1).into());
                }
                show(index, packet)?;
                index += 1;
            }
        }
        Ok(())
    }
}
