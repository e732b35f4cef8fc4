//! What a user does, in words that every shell can translate to.

/// A mouse button, or a touch or pen contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointerButton {
    /// Left button, or a contact.
    Primary,
    /// Right button.
    Secondary,
    /// Middle button.
    Middle,
}

/// What points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointerKind {
    /// Mouse or pen: one at a time.
    Mouse,
    /// A finger: two make a pinch and a pan.
    Touch,
}

/// Keys held with a pointer or key event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Modifiers {
    /// Shift: orbiting pans instead.
    pub shift: bool,
    /// Control or Command: orbiting zooms instead; keys are left to the shell.
    pub control: bool,
    /// Alt: keys are left to the shell.
    pub alt: bool,
}

/// A key that means something here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// Orbits left (with Shift: pans).
    ArrowLeft,
    /// Orbits right (with Shift: pans).
    ArrowRight,
    /// Orbits up (with Shift: pans).
    ArrowUp,
    /// Orbits down (with Shift: pans).
    ArrowDown,
    /// Zooms in.
    Plus,
    /// Zooms out.
    Minus,
    /// Back to the whole model from the front.
    Home,
    /// Standard view `digit − 1`, for 1..=6.
    Digit(u8),
    /// `l` toggles [`Shade::Lod`](crate::Shade::Lod), `w` wire, `n` normals, `g` flying, `z` whether what is drawn stays
    /// as it is; while flying, `w` `a` `s` `d` `q` `e` fly. Others mean nothing.
    Letter(char),
    /// Ends flying.
    Escape,
}

impl Key {
    /// The key that the DOM (`KeyboardEvent.key`) and winit's logical keys name so; `None` if it means nothing.
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "ArrowLeft" => Self::ArrowLeft,
            "ArrowRight" => Self::ArrowRight,
            "ArrowUp" => Self::ArrowUp,
            "ArrowDown" => Self::ArrowDown,
            "+" | "=" => Self::Plus,
            "-" | "_" => Self::Minus,
            "Home" => Self::Home,
            "1" | "2" | "3" | "4" | "5" | "6" => Self::Digit(name.parse().ok()?),
            "Escape" => Self::Escape,
            _ => {
                let mut letters = name.chars();
                let letter = letters.next()?.to_ascii_lowercase();
                let is_known = "lnzgwasdqe".contains(letter) && letters.next().is_none();
                return is_known.then_some(Self::Letter(letter));
            }
        })
    }
}

/// Something the user did. Positions are physical pixels of the viewport, from its upper left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InputEvent {
    /// A button went down or a finger touched.
    PointerDown {
        /// Which pointer, stable until it goes up.
        pointer: u64,
        /// Mouse or finger.
        kind: PointerKind,
        /// Which button.
        button: PointerButton,
        /// Place.
        position: [f64; 2],
        /// Keys held.
        modifiers: Modifiers,
    },
    /// A pointer moved.
    PointerMove {
        /// Which pointer.
        pointer: u64,
        /// Place.
        position: [f64; 2],
    },
    /// A pointer went up, or was taken away.
    PointerUp {
        /// Which pointer.
        pointer: u64,
    },
    /// A wheel or a trackpad scroll.
    Wheel {
        /// Notches (about 100 CSS pixels each), positive towards the user: zooms out.
        notches: f64,
        /// Place; zooming keeps the point below it.
        position: [f64; 2],
    },
    /// A double click, or two taps in quick succession.
    DoubleClick {
        /// Place; the point of the model below it becomes the target.
        position: [f64; 2],
    },
    /// A key went down (repeats included).
    KeyDown {
        /// Which key.
        key: Key,
        /// Keys held.
        modifiers: Modifiers,
    },
    /// A key went up.
    KeyUp {
        /// Which key.
        key: Key,
    },
    /// The shell lost the keyboard: nothing is held any more.
    Blur,
}
