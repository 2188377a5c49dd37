//! Scripts that use the viewer as a person would: they move the mouse, press keys, click on
//! controls by their names, wait, and take screenshots.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use egui::accesskit::{self, NodeId, Role};
use egui::{Event, Key, Modifiers, MouseWheelUnit, PointerButton, Pos2, RawInput, Vec2};

use super::app::App;
use crate::error::{Error, Result};
use crate::files;

/// Longest wait for something that a script does not limit.
const PATIENCE: Duration = Duration::from_secs(120);

/// Time that a control may take to appear.
const OPENING: Duration = Duration::from_secs(2);

/// Time in which a control comes into view that a list or the panel has scrolled away.
const SCROLLING: Duration = Duration::from_millis(200);

/// A command of a script; docs/design/testing.md has all of them.
#[derive(Clone, Debug, PartialEq)]
enum Command {
    Wait(Duration),
    WaitFor(Condition, Duration),
    Key(Modifiers, Key, Duration),
    Type(String),
    Click(String),
    Set(String, f64),
    Press(Pos2, PointerButton, u32),
    Drag(Pos2, Pos2, Duration, PointerButton, Modifiers),
    DragControl(String, Vec2, Duration),
    Wheel(Pos2, f32),
    Resize([u32; 2]),
    Scale(f32),
    Drop(PathBuf),
    Screenshot(PathBuf),
    Mark(String),
    Expect(String),
    ExpectNoErrors,
}

#[derive(Clone, Debug, PartialEq)]
enum Condition {
    Picture,
    Settled,
    Samples(u32),
    Compared,
    Text(String),
}

impl Condition {
    fn name(&self) -> String {
        match self {
            Self::Picture => "a picture".into(),
            Self::Settled => "images that have settled".into(),
            Self::Samples(count) => format!("an image of {count} samples of each pixel"),
            Self::Compared => "a comparison".into(),
            Self::Text(text) => format!("the text \"{text}\""),
        }
    }
}

/// Requests of a script to its host.
#[derive(Clone, Debug, Default)]
pub struct HostRequests {
    /// Save what the window shows.
    pub screenshot: Option<PathBuf>,
    /// Change the window's size, points.
    pub resize: Option<[u32; 2]>,
    /// Change the display's scale: pixels per point, before the zoom of the user interface.
    pub scale: Option<f32>,
}

/// Figures of a section of a script.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Section {
    /// Name of the section.
    pub name: String,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Seconds from its beginning to the first picture of the first image.
    pub first_picture_seconds: Option<f64>,
    /// Frames of the user interface.
    pub ui_frames: u32,
    /// Milliseconds of frames of the user interface, input to image: median, 95th percentile,
    /// maximum.
    pub ui_frame_ms: [f64; 3],
    /// Steps of the first image.
    pub pictures: usize,
    /// Milliseconds of steps of the first image: median, 95th percentile.
    pub picture_ms: [f64; 2],
    /// Milliseconds from a request to the first picture that answers it: median, 95th percentile.
    pub latency_ms: [f64; 2],
    /// The last comparison with the truth: RMSE, FLIP, standard error of the truth.
    pub error: Option<(f64, f64, Option<f64>)>,
    /// Resident memory of the process at its end, MiB.
    pub memory_mib: f64,
}

/// A script that is being run.
pub struct Script {
    commands: VecDeque<(usize, Command)>,
    path: PathBuf,
    current: Option<Current>,
    pointer: Pos2,
    section: Measured,
    sections: Vec<Section>,
    tree: Vec<(NodeId, accesskit::Node)>,
    messages_seen: usize,
    errors: Vec<String>,
    /// Number of scenes that could not be loaded, as the script has expected.
    known_failures: usize,
}

struct Current {
    line: usize,
    command: Command,
    start: Instant,
    step: u32,
    /// When its control was asked to scroll into view.
    seen: Option<Instant>,
}

struct Measured {
    name: String,
    start: Instant,
    first_picture: Option<f64>,
    ui_ms: Vec<f64>,
    picture_ms: Vec<f64>,
    latency_ms: Vec<f64>,
    last_request: u64,
    last_picture: Option<std::sync::Arc<super::request::Progress>>,
}

impl Measured {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            start: Instant::now(),
            first_picture: None,
            ui_ms: Vec::new(),
            picture_ms: Vec::new(),
            latency_ms: Vec::new(),
            last_request: 0,
            last_picture: None,
        }
    }

    fn end(&self, app: &App) -> Section {
        let percentile = |values: &[f64], share: f64| crate::measure::stats::percentile(values, share).unwrap_or(0.0);
        Section {
            name: self.name.clone(),
            seconds: self.start.elapsed().as_secs_f64(),
            first_picture_seconds: self.first_picture,
            ui_frames: self.ui_ms.len() as u32,
            ui_frame_ms: [percentile(&self.ui_ms, 0.5), percentile(&self.ui_ms, 0.95), percentile(&self.ui_ms, 1.0)],
            pictures: self.picture_ms.len(),
            picture_ms: [percentile(&self.picture_ms, 0.5), percentile(&self.picture_ms, 0.95)],
            latency_ms: [percentile(&self.latency_ms, 0.5), percentile(&self.latency_ms, 0.95)],
            error: app.comparison.as_ref().map(|c| (c.rmse, c.flip, c.truth_error)),
            memory_mib: resident_mib(),
        }
    }
}

/// Resident memory of the process in MiB; 0 where the system does not say.
fn resident_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib = status
        .lines()
        .find_map(|l| l.strip_prefix("VmRSS:"))
        .and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok());
    kib.unwrap_or(0.0) / 1024.0
}

impl Script {
    /// Reads a script.
    ///
    /// # Errors
    /// [`Error::Input`], naming the line that is no command.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&files::read_text(path)?, path)
    }

    fn parse(text: &str, path: &Path) -> Result<Self> {
        let mut commands = VecDeque::new();
        for (k, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let command =
                parse(line).ok_or_else(|| Error::input(path, format!("line {}: not a command: {line}", k + 1)))?;
            commands.push_back((k + 1, command));
        }
        Ok(Self {
            commands,
            path: path.to_owned(),
            current: None,
            pointer: Pos2::ZERO,
            section: Measured::new("start"),
            sections: Vec::new(),
            tree: Vec::new(),
            messages_seen: 0,
            errors: Vec::new(),
            known_failures: 0,
        })
    }

    /// Notes what a frame of the user interface has shown.
    pub fn observe(&mut self, output: &egui::FullOutput, app: &App) {
        if let Some(update) = &output.platform_output.accesskit_update {
            self.tree.clone_from(&update.nodes);
        }
        let s = &mut self.section;
        if let Some(progress) = &app.panes[0].progress
            && !s.last_picture.as_ref().is_some_and(|p| std::sync::Arc::ptr_eq(p, progress))
        {
            s.picture_ms.push(1e3 * progress.time.as_secs_f64());
            if progress.request != s.last_request {
                s.latency_ms.push(1e3 * progress.latency.as_secs_f64());
                s.last_request = progress.request;
            }
            s.first_picture.get_or_insert(s.start.elapsed().as_secs_f64());
            s.last_picture = Some(progress.clone());
        }
        // the newest messages come first
        let new = app.messages.len().saturating_sub(self.messages_seen);
        for (_, text, is_error) in app.messages.iter().take(new) {
            if *is_error {
                self.errors.push(text.clone());
            }
        }
        self.messages_seen = app.messages.len();
        self.errors.extend(
            app.panes.iter().filter_map(|p| p.error.clone()).filter(|e| !self.errors.contains(e)).collect::<Vec<_>>(),
        );
    }

    /// Notes how long a frame of the user interface took, painting included.
    pub fn observe_time(&mut self, time: Duration) {
        self.section.ui_ms.push(1e3 * time.as_secs_f64());
    }

    /// Adds the input of the next frame. Returns what the host is to do besides; `None`: the script
    /// has ended.
    ///
    /// # Errors
    /// [`Error::CheckFailed`] for what was expected and is not so, naming the line.
    pub fn input(&mut self, input: &mut RawInput, app: &App) -> Result<Option<HostRequests>> {
        let mut requests = HostRequests::default();
        let mut current = match self.current.take() {
            Some(current) => current,
            None => match self.commands.pop_front() {
                Some((line, command)) => Current { line, command, start: Instant::now(), step: 0, seen: None },
                None => {
                    self.end(app);
                    return Ok(None);
                }
            },
        };
        let is_done = self
            .step(&mut current, input, app, &mut requests)
            .map_err(|text| Error::CheckFailed(format!("{}, line {}: {text}", self.path.display(), current.line)))?;
        if !is_done {
            self.current = Some(current);
        }
        Ok(Some(requests))
    }

    /// Ends the last section.
    pub fn end(&mut self, app: &App) {
        self.sections.push(self.section.end(app));
    }

    /// Figures of all sections.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// A step of a command, once a frame; returns true at its end.
    fn step(
        &mut self,
        current: &mut Current,
        input: &mut RawInput,
        app: &App,
        requests: &mut HostRequests,
    ) -> Result<bool, String> {
        let (elapsed, step) = (current.start.elapsed(), current.step);
        current.step += 1;
        match &current.command {
            Command::Wait(time) => Ok(elapsed >= *time),
            Command::WaitFor(condition, most) => self.wait_for(condition, app, step, (elapsed, *most)),

            // keys and text
            Command::Key(modifiers, key, time) => {
                let ends = step > 0 && elapsed >= *time;
                press_key(input, *modifiers, *key, step == 0, ends);
                Ok(ends)
            }
            Command::Type(text) => {
                input.events.push(Event::Text(text.clone()));
                Ok(true)
            }

            // controls by their labels
            Command::Click(label) => {
                if let Some(place) = self.place_in_view(label, &mut current.seen, input, elapsed)? {
                    (current.command, current.step) = (Command::Press(place, PointerButton::Primary, 1), 0);
                }
                Ok(false)
            }
            Command::Set(label, value) => match self.find(label, true) {
                Ok((target, _)) => {
                    let data = Some(accesskit::ActionData::NumericValue(*value));
                    let request = accesskit::ActionRequest { action: accesskit::Action::SetValue, target, data };
                    input.events.push(Event::AccessKitActionRequest(request));
                    Ok(true)
                }
                Err(_) if elapsed < OPENING => Ok(false),
                Err(e) => Err(e),
            },

            // the pointer
            Command::Press(at, button, times) => Ok(self.click(input, *at, *button, step, *times)),
            Command::Drag(from, to, time, button, modifiers) => {
                Ok(self.drag(input, [*from, *to], *time, *button, *modifiers, step, elapsed))
            }
            Command::DragControl(label, by, time) => {
                if let Some(from) = self.place_in_view(label, &mut current.seen, input, elapsed)? {
                    let drag = Command::Drag(from, from + *by, *time, PointerButton::Primary, Modifiers::NONE);
                    (current.command, current.step, current.start) = (drag, 0, Instant::now());
                }
                Ok(false)
            }
            Command::Wheel(at, lines) => {
                self.move_to(input, *at);
                let (unit, delta) = (MouseWheelUnit::Line, Vec2::new(0.0, *lines));
                input.events.push(Event::MouseWheel { unit, delta, modifiers: Modifiers::NONE });
                Ok(true)
            }

            // the window and its files
            Command::Resize(size) => {
                requests.resize = Some(*size);
                Ok(true)
            }
            Command::Scale(scale) => {
                requests.scale = Some(*scale);
                Ok(true)
            }
            Command::Drop(path) => {
                input.dropped_files.push(egui::DroppedFile { path: Some(path.clone()), ..Default::default() });
                Ok(true)
            }
            Command::Screenshot(path) => {
                requests.screenshot = Some(path.clone());
                Ok(true)
            }

            // figures and expectations
            Command::Mark(name) => {
                self.sections.push(self.section.end(app));
                self.section = Measured::new(name);
                // what is on the screen already is none of its pictures
                self.section.last_picture = app.panes[0].progress.clone();
                Ok(true)
            }
            Command::Expect(text) if self.contains(text) => {
                self.known_failures = app.load_failures.len();
                Ok(true)
            }
            Command::Expect(text) => {
                Err(format!("nothing on the screen contains \"{text}\"{}", self.shown_errors(app)))
            }
            Command::ExpectNoErrors => match self.errors.first() {
                None => Ok(true),
                Some(error) => Err(format!("an error was shown: {error}")),
            },
        }
    }

    /// Waits for a condition, for `most` of time; returns true once it holds.
    fn wait_for(
        &mut self,
        condition: &Condition,
        app: &App,
        step: u32,
        (elapsed, most): (Duration, Duration),
    ) -> Result<bool, String> {
        let holds = match condition {
            // of the scene that was opened last
            Condition::Picture => app.panes[0].progress.is_some() && app.control.is_some() && !app.can_cancel_loading(),
            Condition::Settled => app.is_settled(),
            Condition::Samples(count) => app.shown_samples() >= *count || app.is_settled(),
            Condition::Compared => app.comparison.is_some(),
            Condition::Text(text) => self.contains(text),
        };
        // a frame at least, so that what was done before is requested
        if step > 1
            && let Some(why) = self.hopeless(condition, app)
        {
            return Err(format!("{} will not come: {why}", condition.name()));
        }
        if !holds && elapsed > most {
            return Err(format!("waited {most:?} for {}{}", condition.name(), self.shown_errors(app)));
        }
        let ends = holds && step > 1;
        if ends {
            self.acknowledge(condition, app);
        }
        Ok(ends)
    }

    /// The place of a control that has been scrolled into view; `None` while it scrolls or opens.
    fn place_in_view(
        &mut self,
        label: &str,
        since: &mut Option<Instant>,
        input: &mut RawInput,
        elapsed: Duration,
    ) -> Result<Option<Pos2>, String> {
        match self.bring_into_view(label, *since, input) {
            Ok(seen) if seen.elapsed() < SCROLLING => {
                *since = Some(seen);
                // a frame shows it where it is now
                self.move_to(input, self.pointer);
                Ok(None)
            }
            Ok(_) => self.place_of(label).map(Some),
            // a menu or a list opens with the next frame
            Err(_) if elapsed < OPENING => Ok(None),
            Err(e) => Err(e),
        }
    }

    /// Why a wait for an image would be in vain.
    fn hopeless(&self, condition: &Condition, app: &App) -> Option<String> {
        if matches!(condition, Condition::Text(_)) {
            return None;
        }
        let failed_load = (app.load_failures.len() > self.known_failures).then(|| app.load_failures.last().cloned());
        let compares = !matches!(condition, Condition::Compared) || app.compares_now();
        app.failure
            .clone()
            .or_else(|| failed_load.flatten())
            .or_else(|| app.source.is_none().then(|| "no scene is open".into()))
            .or_else(|| app.panes[0].error.clone())
            .or_else(|| (!compares).then(|| "nothing is compared".into()))
    }

    /// A script that waits for a text knows of the scenes that could not be loaded before.
    fn acknowledge(&mut self, condition: &Condition, app: &App) {
        if matches!(condition, Condition::Text(_)) {
            self.known_failures = app.load_failures.len();
        }
    }

    fn shown_errors(&self, app: &App) -> String {
        let errors: Vec<_> = app.failure.iter().chain(&self.errors).take(3).cloned().collect();
        if errors.is_empty() { String::new() } else { format!(" ({})", errors.join("; ")) }
    }

    fn move_to(&mut self, input: &mut RawInput, at: Pos2) {
        self.pointer = at;
        input.events.push(Event::PointerMoved(at));
    }

    /// A click over several frames: move, then press and release. Both in one frame: where frames
    /// are slow, what is released in a later one is no click, but a long press. Returns true at its
    /// end.
    fn click(&mut self, input: &mut RawInput, at: Pos2, button: PointerButton, step: u32, times: u32) -> bool {
        if step == 0 {
            self.move_to(input, at);
            return false;
        }
        for pressed in [true, false] {
            input.events.push(Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
        }
        step >= times
    }

    #[allow(clippy::too_many_arguments, reason = "what a drag consists of")]
    fn drag(
        &mut self,
        input: &mut RawInput,
        [from, to]: [Pos2; 2],
        time: Duration,
        button: PointerButton,
        modifiers: Modifiers,
        step: u32,
        elapsed: Duration,
    ) -> bool {
        input.modifiers = modifiers;
        let share = (elapsed.as_secs_f32() / time.as_secs_f32().max(1e-3)).min(1.0);
        let at = from + (to - from) * share;
        let event = |pos, pressed| Event::PointerButton { pos, button, pressed, modifiers };
        match step {
            0 => self.move_to(input, from),
            1 => input.events.push(event(from, true)),
            _ => self.move_to(input, at),
        }
        let ends = step > 1 && share >= 1.0;
        if ends {
            input.events.push(event(to, false));
        }
        ends
    }

    fn name_of(&self, node: &accesskit::Node) -> String {
        let own = node.label().or(if node.role() == Role::Label { node.value() } else { None });
        if let Some(own) = own.filter(|o| !o.is_empty()) {
            return own.to_owned();
        }
        let labelled = |id: &NodeId| self.tree.iter().find(|(k, _)| k == id).map(|(_, n)| n);
        let labels = node.labelled_by().iter().filter_map(labelled).filter_map(|n| n.label().or(n.value()));
        labels.collect::<Vec<_>>().join(" ")
    }

    /// Finds a control by its name: exactly, or as the beginning of it. `is_number`: only what has
    /// a numeric value.
    fn find(&self, label: &str, is_number: bool) -> Result<(NodeId, &accesskit::Node), String> {
        let fits = |n: &accesskit::Node| {
            let is_text = n.role() == Role::Label && !is_number;
            !n.is_disabled()
                && n.bounds().is_some()
                && (!is_number || n.numeric_value().is_some() || n.role() == Role::SpinButton)
                && !is_text
        };
        let all: Vec<_> = self.tree.iter().filter(|(_, n)| fits(n)).map(|(id, n)| (*id, n, self.name_of(n))).collect();
        let found = all.iter().find(|a| a.2 == label).or_else(|| all.iter().find(|a| a.2.starts_with(label)));
        found.map(|f| (f.0, f.1)).ok_or_else(|| {
            let names: Vec<_> = all.iter().map(|a| a.2.as_str()).filter(|n| !n.is_empty()).collect();
            format!("no control is called \"{label}\"; there are: {}", names.join(", "))
        })
    }

    /// Has a control scrolled into view, unless that was requested before (`seen`). Returns when.
    fn bring_into_view(&self, label: &str, seen: Option<Instant>, input: &mut RawInput) -> Result<Instant, String> {
        let target = self.find(label, false)?.0;
        Ok(seen.unwrap_or_else(|| {
            let request = accesskit::ActionRequest { action: accesskit::Action::ScrollIntoView, target, data: None };
            input.events.push(Event::AccessKitActionRequest(request));
            Instant::now()
        }))
    }

    fn place_of(&self, label: &str) -> Result<Pos2, String> {
        let bounds = self.find(label, false)?.1.bounds().unwrap_or_default();
        Ok(Pos2::new((0.5 * (bounds.x0 + bounds.x1)) as f32, (0.5 * (bounds.y0 + bounds.y1)) as f32))
    }

    fn contains(&self, text: &str) -> bool {
        self.tree.iter().any(|(_, n)| self.name_of(n).contains(text) || n.value().is_some_and(|v| v.contains(text)))
    }
}

/// Presses a key where it `begins`, and releases it where it `ends`.
fn press_key(input: &mut RawInput, modifiers: Modifiers, key: Key, begins: bool, ends: bool) {
    let event = |pressed| Event::Key { key, physical_key: None, pressed, repeat: false, modifiers };
    input.modifiers = modifiers;
    if begins {
        input.events.push(event(true));
        if modifiers.command && key == Key::C {
            input.events.push(Event::Copy);
        }
        // a question mark is text on keyboards
    }
    if ends {
        input.events.push(event(false));
    }
}

fn parse(line: &str) -> Option<Command> {
    let (name, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let rest = rest.trim();
    let words: Vec<&str> = rest.split_whitespace().collect();

    // words as numbers, places and times
    let number = |k: usize| words.get(k)?.parse::<f32>().ok().filter(|x| x.is_finite());
    let at = |k: usize| Some(Pos2::new(number(k)?, number(k + 1)?));
    let seconds = |k: usize, default: f32| {
        Some(Duration::from_secs_f32(words.get(k).map_or(Some(default), |_| number(k))?.clamp(0.0, 1e6)))
    };
    let patience = |k: usize| seconds(k, PATIENCE.as_secs_f32());
    let button = |word: &str| match word {
        "left" | "shift" => Some(PointerButton::Primary),
        "right" => Some(PointerButton::Secondary),
        "middle" => Some(PointerButton::Middle),
        _ => None,
    };

    Some(match name {
        "wait" => match *words.first()? {
            "picture" => Command::WaitFor(Condition::Picture, patience(1)?),
            "settled" => Command::WaitFor(Condition::Settled, patience(1)?),
            "samples" => {
                let count = words.get(1)?.parse().ok().filter(|count| *count > 0)?;
                Command::WaitFor(Condition::Samples(count), patience(2)?)
            }
            "compared" => Command::WaitFor(Condition::Compared, patience(1)?),
            text if text.starts_with("text:") => {
                let text = rest.strip_prefix("text:")?;
                Command::WaitFor(Condition::Text(text.to_owned()), PATIENCE)
            }
            _ => Command::Wait(seconds(0, 0.0)?),
        },
        "key" => {
            let mut modifiers = Modifiers::NONE;
            let mut key = *words.first()?;
            while let Some((modifier, left)) = key.split_once('+').filter(|(_, left)| !left.is_empty()) {
                modifiers = match modifier {
                    "Ctrl" => modifiers | Modifiers::COMMAND | Modifiers::CTRL,
                    "Shift" => modifiers | Modifiers::SHIFT,
                    "Alt" => modifiers | Modifiers::ALT,
                    _ => return None,
                };
                key = left;
            }
            Command::Key(modifiers, Key::from_name(key)?, seconds(1, 0.0)?)
        }
        "type" if !rest.is_empty() => Command::Type(rest.to_owned()),
        "click" if !rest.is_empty() => Command::Click(rest.to_owned()),
        "set" => {
            let (label, value) = rest.rsplit_once('=')?;
            Command::Set(label.trim().to_owned(), value.trim().parse().ok()?)
        }
        "press" => {
            let word = words.get(2).copied().unwrap_or("left");
            Command::Press(at(0)?, button(word)?, if words.get(3) == Some(&"2") { 2 } else { 1 })
        }
        "drag" => {
            let word = words.get(5).copied().unwrap_or("left");
            let modifiers = if word == "shift" { Modifiers::SHIFT } else { Modifiers::NONE };
            Command::Drag(at(0)?, at(2)?, seconds(4, 0.5)?, button(word)?, modifiers)
        }
        "drag-control" => {
            // the label may have spaces: numbers are at the end
            let numbers = words.iter().rev().take_while(|w| w.parse::<f32>().is_ok()).count();
            let first = words.len() - numbers;
            let label = words[..first].join(" ");
            (numbers >= 2 && !label.is_empty()).then_some(())?;
            Command::DragControl(label, Vec2::new(number(first)?, number(first + 1)?), seconds(first + 2, 0.5)?)
        }
        "wheel" => Command::Wheel(at(0)?, number(2)?),
        "resize" => Command::Resize([words.first()?.parse().ok()?, words.get(1)?.parse().ok()?]),
        "scale" => Command::Scale(number(0).filter(|scale| (0.25..=4.0).contains(scale))?),
        "drop" if !rest.is_empty() => Command::Drop(rest.into()),
        "screenshot" if !rest.is_empty() => Command::Screenshot(rest.into()),
        "mark" if !rest.is_empty() => Command::Mark(rest.to_owned()),
        "expect" if !rest.is_empty() => Command::Expect(rest.to_owned()),
        "expect-no-errors" => Command::ExpectNoErrors,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_read() {
        let read = |line: &str| parse(line);
        assert_eq!(read("wait 0.5"), Some(Command::Wait(Duration::from_millis(500))));
        assert_eq!(read("wait samples 32"), Some(Command::WaitFor(Condition::Samples(32), PATIENCE)));
        assert_eq!(read("wait samples 8 7"), Some(Command::WaitFor(Condition::Samples(8), Duration::from_secs(7))));
        assert!(
            read("wait samples").is_none() && read("wait samples 0").is_none() && read("wait samples many").is_none()
        );
        assert_eq!(read("wait settled 7"), Some(Command::WaitFor(Condition::Settled, Duration::from_secs(7))));
        assert_eq!(
            read("wait text:Open a scene"),
            Some(Command::WaitFor(Condition::Text("Open a scene".into()), PATIENCE))
        );
        assert_eq!(
            read("key Ctrl+S"),
            Some(Command::Key(Modifiers::COMMAND | Modifiers::CTRL, Key::S, Duration::ZERO))
        );
        assert_eq!(read("set AO radius = 0.5"), Some(Command::Set("AO radius".into(), 0.5)));
        let drag = Command::Drag(
            Pos2::new(1.0, 2.0),
            Pos2::new(3.0, 4.0),
            Duration::from_millis(500),
            PointerButton::Primary,
            Modifiers::SHIFT,
        );
        assert_eq!(read("drag 1 2 3 4 0.5 shift"), Some(drag));
        let control = Command::DragControl("Line between".into(), Vec2::new(-50.0, 0.0), Duration::from_secs(1));
        assert_eq!(read("drag-control Line between -50 0 1"), Some(control));
        assert_eq!(read("press 5 6 right"), Some(Command::Press(Pos2::new(5.0, 6.0), PointerButton::Secondary, 1)));
        for bad in [
            "",
            "wait",
            "wait long",
            "key",
            "key Ctrl+Nothing",
            "drag 1 2 3",
            "click",
            "set Radius",
            "dance",
            "wheel 1 2",
            "resize 5",
            "scale 0",
            "scale",
        ] {
            assert_eq!(read(bad), None, "{bad}");
        }
        let script = Script::parse("# nothing\n\n wait 1\nfly", Path::new("a.txt"));
        assert!(script.err().unwrap().to_string().contains("line 4"));
    }
}
