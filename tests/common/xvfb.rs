//! An X server of the test's own, and a user before it: it looks at the screen, moves the pointer and presses keys.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use x11rb::connection::{Connection, RequestConnection};
use x11rb::protocol::xproto::{
    BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ClientMessageEvent, ConnectionExt, EventMask, ImageFormat, InputFocus,
    KEY_PRESS_EVENT, KEY_RELEASE_EVENT, MOTION_NOTIFY_EVENT, MapState,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

/// Buttons of a mouse.
pub(crate) const LEFT: u8 = 1;
pub(crate) const RIGHT: u8 = 3;
pub(crate) const WHEEL_UP: u8 = 4;
pub(crate) const WHEEL_DOWN: u8 = 5;

/// A screen in memory; the server ends with it.
pub(crate) struct Screen {
    server: Child,
    /// For `DISPLAY`.
    pub(crate) name: String,
    connection: RustConnection,
    root: u32,
    size: (u16, u16),
}

impl Screen {
    /// # Panics
    /// Without Xvfb, saying what to install.
    pub(crate) fn start(width: u16, height: u16) -> Self {
        let screen = format!("{width}x{height}x24");
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp", "-noreset"]);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut server = command.spawn().unwrap_or_else(|error| {
            panic!("Xvfb cannot be started ({error}); install it (Debian: apt-get install xvfb)")
        });
        // The server tells its number once clients can connect, or ends.
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let name = format!(":{}", number.trim());
        let (connection, index) = x11rb::connect(Some(&name)).unwrap_or_else(|error| {
            let _ = server.kill();
            panic!("Xvfb does not answer at {name}: {error}")
        });
        let root = connection.setup().roots[index].root;
        let has_xtest = connection.extension_information("XTEST").unwrap().is_some();
        assert!(has_xtest, "Xvfb has no extension XTEST");
        Self { server, name, connection, root, size: (width, height) }
    }

    /// The whole screen: red, green, blue a pixel, rows from the top.
    pub(crate) fn grab(&self) -> Vec<u8> {
        let (width, height) = self.size;
        let image = self.connection.get_image(ImageFormat::Z_PIXMAP, self.root, 0, 0, width, height, !0).unwrap();
        let bgrx = image.reply().unwrap().data;
        assert_eq!(bgrx.len(), 4 * usize::from(width) * usize::from(height), "32 bits a pixel");
        bgrx.chunks_exact(4).flat_map(|pixel| [pixel[2], pixel[1], pixel[0]]).collect()
    }

    fn fake(&self, kind: u8, detail: u8, (x, y): (i16, i16)) {
        self.connection.xtest_fake_input(kind, detail, 0, self.root, x, y, 0).unwrap();
        self.connection.sync().unwrap();
    }

    pub(crate) fn point(&self, x: f32, y: f32) {
        self.fake(MOTION_NOTIFY_EVENT, 0, (x.round() as i16, y.round() as i16));
    }

    pub(crate) fn press(&self, button: u8) {
        self.fake(BUTTON_PRESS_EVENT, button, (0, 0));
    }

    pub(crate) fn release(&self, button: u8) {
        self.fake(BUTTON_RELEASE_EVENT, button, (0, 0));
    }

    /// Presses a key and lets it go. `key` is a letter, a digit, or a keysym.
    pub(crate) fn key(&self, key: impl Into<u32>) {
        let code = self.code(key.into());
        self.fake(KEY_PRESS_EVENT, code, (0, 0));
        self.fake(KEY_RELEASE_EVENT, code, (0, 0));
    }

    fn code(&self, keysym: u32) -> u8 {
        let (first, last) = (self.connection.setup().min_keycode, self.connection.setup().max_keycode);
        let mapping = self.connection.get_keyboard_mapping(first, last - first + 1).unwrap().reply().unwrap();
        let mut codes = mapping.keysyms.chunks(mapping.keysyms_per_keycode.into());
        first + codes.position(|keysyms| keysyms[0] == keysym).expect("a key of the keyboard") as u8
    }

    /// Gives keys to the one window, as a window manager does.
    pub(crate) fn focus(&self) {
        for window in self.windows() {
            self.connection.set_input_focus(InputFocus::POINTER_ROOT, window, x11rb::CURRENT_TIME).unwrap();
        }
        self.connection.sync().unwrap();
    }

    /// The windows that are shown.
    fn windows(&self) -> Vec<u32> {
        let children = self.connection.query_tree(self.root).unwrap().reply().unwrap().children;
        let is_shown = |window: &u32| {
            let attributes = self.connection.get_window_attributes(*window).unwrap();
            attributes.reply().is_ok_and(|attributes| attributes.map_state == MapState::VIEWABLE)
        };
        children.into_iter().filter(is_shown).collect()
    }

    /// Asks the one window to close, as a window manager does.
    pub(crate) fn close_window(&self) {
        let atom = |name: &str| self.connection.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom;
        let (protocols, delete) = (atom("WM_PROTOCOLS"), atom("WM_DELETE_WINDOW"));
        for window in self.windows() {
            let message = ClientMessageEvent::new(32, window, protocols, [delete, 0, 0, 0, 0]);
            self.connection.send_event(false, window, EventMask::NO_EVENT, message).unwrap();
        }
        self.connection.sync().unwrap();
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}
