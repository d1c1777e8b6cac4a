//! The pieces that a thread used last, unpacked.

use std::{any::Any, cell::RefCell};

use super::{
    PIECE,
    kept::{Kept, lose},
};
use crate::packed::{self, Packed};

/// Pieces that a thread keeps: more than the columns of a shot, which are often read together.
const PIECES: usize = 48;
/// Number of hints where the piece of a number is; a power of two.
const HINTS: usize = 256;

thread_local! {
    static UNPACKED: RefCell<Unpacked> = const { RefCell::new(Unpacked::new()) };
}

/// The unpacked pieces of a thread.
pub(super) struct Unpacked {
    slots: Vec<Slot>,
    hints: [u8; HINTS],
    clock: u64,
}

struct Slot {
    /// Number of the piece.
    number: u64,
    used: u64,
    /// `Vec<T>` of the type of the column.
    values: Box<dyn Any>,
}

impl Unpacked {
    const fn new() -> Self {
        Self {
            slots: Vec::new(),
            hints: [0; HINTS],
            clock: 0,
        }
    }

    /// The value in this row of a piece.
    pub(super) fn value<T: Packed>(piece: &Kept, row: usize) -> T {
        UNPACKED.with_borrow_mut(|unpacked| {
            let values = unpacked.slot::<T>(piece).values.downcast_ref::<Vec<T>>();
            let value = values.and_then(|values| values.get(row));
            value.copied().unwrap_or_else(|| lose())
        })
    }

    fn slot<T: Packed>(&mut self, piece: &Kept) -> &Slot {
        self.clock += 1;
        #[allow(clippy::cast_possible_truncation, reason = "only the last bits count")]
        let hint = piece.number as usize % HINTS;
        let mut place = usize::from(self.hints[hint]);
        let is_it = |slot: &Slot| slot.number == piece.number;
        if !self.slots.get(place).is_some_and(is_it) {
            place = (self.slots.iter().position(is_it)).unwrap_or_else(|| self.unpack::<T>(piece));
            #[allow(clippy::cast_possible_truncation, reason = "there are fewer slots")]
            {
                self.hints[hint] = place as u8;
            }
        }
        let slot = &mut self.slots[place];
        slot.used = self.clock;
        slot
    }

    /// Unpacks a piece in place of the one that was not used for longest.
    fn unpack<T: Packed>(&mut self, piece: &Kept) -> usize {
        let values: Option<Vec<T>> = packed::values(&piece.bytes());
        let values = values.filter(|values| values.len() == PIECE);
        let values = values.unwrap_or_else(|| lose());
        let slot = Slot {
            number: piece.number,
            used: self.clock,
            values: Box::new(values),
        };
        if self.slots.len() < PIECES {
            self.slots.push(slot);
            return self.slots.len() - 1;
        }
        let used = self.slots.iter().enumerate();
        let oldest = used.min_by_key(|(_, slot)| slot.used);
        let place = oldest.map_or(0, |(place, _)| place);
        self.slots[place] = slot;
        place
    }
}
