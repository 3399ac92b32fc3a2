//! The part of XPath 1.0 that clients of an agent write: `/`, `//`, names, `*`, predicates of attributes with `and` and
//! `or`, and `|` between paths. It selects elements of the probe document.

use std::borrow::Cow;
use std::collections::BTreeSet;

use super::buffer::ItemKey;
use super::model::Device;

/// Longest path, bytes, and most steps in it: what a client may have worked out.
const MAX_BYTES: usize = 4_096;
const MAX_STEPS: usize = 64;

/// Why a path selects nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum PathError {
    /// It cannot be read.
    Syntax(String),
    /// It can, and there is no such item.
    Nothing,
}

/// `@name = "value"`
#[derive(Clone, Debug, PartialEq, Eq)]
struct Test {
    name: String,
    value: String,
}

/// Alternatives, each of tests that all have to hold.
type Predicate = Vec<Vec<Test>>;

#[derive(Clone, Debug, PartialEq, Eq)]
struct Step {
    /// Whether it may be any level down.
    is_deep: bool,
    /// Name of the element; `None`: any.
    name: Option<String>,
    predicates: Vec<Predicate>,
}

/// An element of the probe document.
struct Node<'a> {
    parent: Option<usize>,
    name: &'a str,
    attributes: Vec<(&'a str, Cow<'a, str>)>,
    item: Option<ItemKey>,
}

/// The items that a path selects of these devices, given with their numbers.
pub(super) fn select<'a>(
    path: &str,
    devices: impl Iterator<Item = (u32, &'a Device)>,
) -> Result<BTreeSet<ItemKey>, PathError> {
    let paths = Reader::new(path)?.paths()?;
    let nodes = tree(devices);
    let mut items = BTreeSet::new();
    for steps in &paths {
        let mut selected = vec![false; nodes.len()];
        selected[0] = true;
        for step in steps {
            selected = follow(&nodes, &selected, step);
        }
        // Everything below what is selected.
        for (index, node) in nodes.iter().enumerate() {
            selected[index] |= node.parent.is_some_and(|parent| selected[parent]);
        }
        let found = nodes.iter().zip(&selected).filter(|(_, selected)| **selected);
        items.extend(found.filter_map(|(node, _)| node.item));
    }
    if items.is_empty() { Err(PathError::Nothing) } else { Ok(items) }
}

/// The elements that a step leads to. Parents are before their children.
fn follow(nodes: &[Node<'_>], from: &[bool], step: &Step) -> Vec<bool> {
    let mut below = vec![false; nodes.len()];
    let mut selected = vec![false; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        let Some(parent) = node.parent else { continue };
        below[index] = from[parent] || (step.is_deep && below[parent]);
        let is_named = step.name.as_deref().is_none_or(|name| name == node.name);
        selected[index] = below[index] && is_named && step.predicates.iter().all(|predicate| holds(predicate, node));
    }
    selected
}

fn holds(predicate: &Predicate, node: &Node<'_>) -> bool {
    let test = |test: &Test| node.attributes.iter().any(|(name, value)| *name == test.name && *value == test.value);
    predicate.iter().any(|tests| tests.iter().all(test))
}

/// The elements of the probe document that have to do with items; the document itself is the first.
fn tree<'a>(devices: impl Iterator<Item = (u32, &'a Device)>) -> Vec<Node<'a>> {
    let mut nodes: Vec<Node<'a>> = Vec::new();
    let mut add = |parent, name, attributes, item| {
        nodes.push(Node { parent, name, attributes, item });
        nodes.len() - 1
    };
    let document = add(None, "", Vec::new(), None);
    let root = add(Some(document), "MTConnectDevices", Vec::new(), None);
    let all = add(Some(root), "Devices", Vec::new(), None);
    for (number, device) in devices {
        // Of each component its own element, that of its items and that of its parts.
        let mut places: Vec<[usize; 3]> = Vec::new();
        for component in &device.components {
            let parent = component.parent.map_or(all, |parent| places[parent][2]);
            let name = component.name.as_deref().map(|name| ("name", name.into()));
            let uuid = component.parent.is_none().then(|| ("uuid", device.uuid().into()));
            let attributes = [("id", component.id.as_str().into())].into_iter().chain(name).chain(uuid).collect();
            let own = add(Some(parent), component.kind, attributes, None);
            let items = add(Some(own), "DataItems", Vec::new(), None);
            places.push([own, items, add(Some(own), "Components", Vec::new(), None)]);
        }
        for (index, item) in (0..).zip(&device.items) {
            let optional = [
                ("subType", item.sub_type),
                ("statistic", item.statistic),
                ("name", item.name),
                ("units", item.units),
                ("coordinateSystem", item.coordinate_system),
            ];
            let attributes = [("id", item.id.as_str()), ("type", item.kind), ("category", item.category.name())];
            let given = optional.into_iter().filter_map(|(name, value)| Some((name, value?)));
            let attributes = attributes.into_iter().chain(given).map(|(name, value)| (name, value.into())).collect();
            add(Some(places[item.component][1]), "DataItem", attributes, Some((number, index)));
        }
    }
    nodes
}

/// Reads a path.
struct Reader<'a> {
    rest: &'a str,
}

impl<'a> Reader<'a> {
    fn new(path: &'a str) -> Result<Self, PathError> {
        if path.len() > MAX_BYTES {
            return Err(PathError::Syntax(format!("it has more than {MAX_BYTES} bytes")));
        }
        Ok(Self { rest: path })
    }

    fn wrong<T>(&self, wanted: &str) -> Result<T, PathError> {
        let found: String = self.rest.chars().take(20).collect();
        let found = if found.is_empty() { "its end".to_owned() } else { format!("{found:?}") };
        Err(PathError::Syntax(format!("{wanted} is expected, not {found}")))
    }

    fn skip_blanks(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn takes(&mut self, token: &str) -> bool {
        match self.rest.strip_prefix(token) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn paths(mut self) -> Result<Vec<Vec<Step>>, PathError> {
        let mut paths = Vec::new();
        let mut steps = 0;
        loop {
            self.skip_blanks();
            let path = self.path()?;
            steps += path.len();
            if steps > MAX_STEPS {
                return Err(PathError::Syntax(format!("it has more than {MAX_STEPS} steps")));
            }
            paths.push(path);
            self.skip_blanks();
            if self.rest.is_empty() {
                return Ok(paths);
            }
            if !self.takes("|") {
                return self.wrong("| or the end");
            }
        }
    }

    fn path(&mut self) -> Result<Vec<Step>, PathError> {
        let mut steps = Vec::new();
        loop {
            let is_deep = self.takes("//");
            let is_step = is_deep || self.takes("/");
            // A path without a slash begins at the document as well.
            if !is_step && !steps.is_empty() {
                return Ok(steps);
            }
            let name = self.name()?;
            let mut predicates = Vec::new();
            while self.takes("[") {
                predicates.push(self.predicate()?);
            }
            steps.push(Step { is_deep, name, predicates });
        }
    }

    fn name(&mut self) -> Result<Option<String>, PathError> {
        if self.takes("*") {
            return Ok(None);
        }
        Ok(Some(self.word("the name of an element or *")?))
    }

    fn word(&mut self, what: &str) -> Result<String, PathError> {
        let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
        let end = self.rest.find(|c| !is_part(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        if !word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
            return self.wrong(what);
        }
        self.rest = rest;
        Ok(word.to_owned())
    }

    /// What is between brackets: `and` binds closer than `or`.
    fn predicate(&mut self) -> Result<Predicate, PathError> {
        let mut alternatives = vec![vec![self.test()?]];
        loop {
            self.skip_blanks();
            if self.takes("]") {
                return Ok(alternatives);
            }
            let operator = self.word("and, or, ]")?;
            let test = self.test()?;
            match (operator.as_str(), alternatives.last_mut()) {
                ("and", Some(tests)) => tests.push(test),
                ("or", _) => alternatives.push(vec![test]),
                _ => return self.wrong("and, or, ]"),
            }
        }
    }

    fn test(&mut self) -> Result<Test, PathError> {
        self.skip_blanks();
        if !self.takes("@") {
            return self.wrong("@");
        }
        let name = self.word("the name of an attribute")?;
        self.skip_blanks();
        if !self.takes("=") {
            return self.wrong("=");
        }
        self.skip_blanks();
        let quote = if self.takes("'") {
            '\''
        } else if self.takes("\"") {
            '"'
        } else {
            return self.wrong("a quoted text");
        };
        let Some((value, rest)) = self.rest.split_once(quote) else { return self.wrong("the end of the text") };
        self.rest = rest;
        Ok(Test { name, value: value.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::Axis;
    use super::*;

    fn devices() -> [Device; 2] {
        let axis = |name: &&str| Axis { name: (*name).to_owned(), turns: *name == "C", travel: [None; 2] };
        let axes = |names: &[&str]| names.iter().map(axis).collect::<Vec<_>>();
        [Device::new("lathe", &axes(&["X", "Z"])), Device::new("mill-5", &axes(&["X", "Y", "Z", "C"]))]
    }

    fn ids(path: &str) -> Result<Vec<String>, PathError> {
        let devices = devices();
        let found = select(path, (0..).zip(&devices))?;
        Ok(found.iter().map(|(device, item)| devices[*device as usize].items[*item as usize].id.clone()).collect())
    }

    #[test]
    fn paths_select_items_of_the_probe() {
        assert_eq!(ids("//DataItem[@type='AVAILABILITY']").unwrap(), ["lathe_avail", "mill-5_avail"]);
        assert_eq!(ids("//Device[@name=\"lathe\"]//DataItem[@type=\"EXECUTION\"]").unwrap(), ["lathe_exec"]);
        assert_eq!(ids("//Axes//Linear[@name='Y']").unwrap(), ["mill-5_a1pos"]);
        assert_eq!(ids("/MTConnectDevices/Devices/Device[@id='lathe']/DataItems").unwrap(), ["lathe_avail"]);
        assert_eq!(ids("//Rotary[@name='C']/DataItems/*").unwrap(), ["mill-5_a3ang"]);
        let both = ids("//DataItem[@type='DISPLACEMENT' and @statistic='MAXIMUM' or @id='lathe_mot']").unwrap();
        assert_eq!(both, ["lathe_sdef", "lathe_mot", "mill-5_sdef"]);
        assert_eq!(ids("//Path//DataItem[@category='CONDITION'] | //Device/DataItems/DataItem").unwrap().len(), 4);
        let of_lathe = devices()[0].items.len();
        assert_eq!(ids("//Device[@id='lathe']").unwrap().len(), of_lathe);
        assert_eq!(ids("//Device[@uuid='feedwave.lathe']").unwrap().len(), of_lathe);
    }

    #[test]
    fn what_is_no_path_is_refused() {
        for path in [
            "",
            "/",
            "//",
            "//////Linear",
            "//Axes?//Linear",
            "//DataItem[",
            "//DataItem[@type='A'",
            "//DataItem[@type=A]",
            "//DataItem[type='A']",
            "//DataItem[1]",
            "//m:DataItem",
            "//A |",
            "//A B",
            "//A[@x='1' nor @y='2']",
            "//DataItem[@type='A\"]",
            "count(//DataItem)",
            "//..",
            &"//A".repeat(65),
            &"/".repeat(5_000),
        ] {
            assert!(matches!(ids(path), Err(PathError::Syntax(_))), "{path:?}: {:?}", ids(path));
        }
        for path in ["//Linear[@name='W']", "/Device", "//DataItem/DataItem"] {
            assert_eq!(ids(path), Err(PathError::Nothing), "{path}");
        }
    }
}
