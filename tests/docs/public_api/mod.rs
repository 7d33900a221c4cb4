//! The library's public interface as text in `tests/docs/public-api.txt`. A change of the interface changes this
//! file. The text is read from the sources, because rustdoc's JSON needs an unstable compiler. It does not contain
//! the tables generated from `layouts/`, which the layout hash covers. For items that macros generate, it contains
//! the macro's input.

mod skeleton;
mod tree;

use std::collections::BTreeMap;
use std::path::Path;
use syn::{Item, Type};
use tree::{Found, Module};

/// If this variable has any value, the test writes the text again.
const UPDATE: &str = "COMMRAM_UPDATE_PUBLIC_API";

/// Module of the operations and replies.
const REQUEST: &str = "request";
/// Tables in [`REQUEST`], each a macro in a module of its name, and the enums that they declare there.
const TABLES: [(&str, &str); 2] = [("ops", "Op"), ("replies", "Reply")];

/// Maximum length of a chain of re-exports.
const DEPTH: u8 = 12;

/// Items by the path of the public module that shows them.
#[derive(Default)]
struct VisibleItems<'a> {
    modules: BTreeMap<String, Vec<Item>>,
    /// Module that shows an item first, by defining module and name.
    places: BTreeMap<(&'a [String], String), String>,
}

fn path_text(path: &[String]) -> String {
    ["commram"].into_iter().chain(path.iter().map(String::as_str)).collect::<Vec<_>>().join("::")
}

impl<'a> VisibleItems<'a> {
    /// Collects all items of the module that users see. `path` is the path by which users name the module.
    fn module(&mut self, root: &'a Module, module: &'a Module, path: &[String]) {
        self.modules.entry(path_text(path)).or_default();
        for item in &module.items {
            if let Item::Macro(made) = item
                && made.ident.is_none()
            {
                self.push(path, item.clone());
            }
            if !tree::is_public(item) {
                continue;
            }
            match item {
                Item::Mod(child) => {
                    self.push(path, skeleton::of(item));
                    let name = child.ident.to_string();
                    let child = module.child(&name).expect("a module that was read");
                    self.module(root, child, &[path, &[name]].concat());
                }
                Item::Use(import) => {
                    for branch in tree::branches(&import.tree) {
                        match root.resolve(module, &branch.path, DEPTH) {
                            Some(found) => self.export(root, found, branch.name, path),
                            None => self.push(path, skeleton::of(item)),
                        }
                    }
                }
                _ => self.item(module, item, path),
            }
        }
    }

    /// Collects the items that a `pub use` shows.
    fn export(&mut self, root: &'a Module, found: Found<'a>, name: Option<String>, path: &[String]) {
        match (found, name) {
            (Found::Module(module), None) => self.module(root, module, path),
            (Found::Module(module), Some(name)) => self.module(root, module, &[path, &[name]].concat()),
            (Found::Item(module, item), _) => self.item(module, item, path),
        }
    }

    fn item(&mut self, module: &'a Module, item: &'a Item, path: &[String]) {
        if let Some(name) = tree::name_of(item) {
            self.places.entry((&module.path, name)).or_insert_with(|| path_text(path));
        }
        self.push(path, skeleton::of(item));
    }

    fn push(&mut self, path: &[String], item: Item) {
        self.modules.entry(path_text(path)).or_default().push(item);
    }

    /// Lists the tables, because macros write their enums.
    fn tables(&mut self, root: &'a Module) {
        for (table, _) in TABLES {
            let module = root.child(REQUEST).and_then(|request| request.child(table)).expect("a table");
            for item in module.items.iter().filter(|item| matches!(item, Item::Macro(_))) {
                self.push(&[REQUEST.to_owned()], item.clone());
            }
        }
    }

    /// Lists each implementation with its type, or with the trait if only the trait belongs to the library.
    fn implementations(&mut self, root: &'a Module) {
        for module in root.all() {
            for item in &module.items {
                let Item::Impl(implementation) = item else { continue };
                let Some(made) = skeleton::implementation(implementation) else { continue };
                let of_type = type_path(&implementation.self_ty);
                let of_trait = implementation.trait_.as_ref().map(|(_, path, _)| segments(path));
                let place = [of_type, of_trait].into_iter().flatten().find_map(|path| {
                    if TABLES.iter().any(|(_, declared)| path == [*declared]) {
                        return Some(path_text(&[REQUEST.to_owned()]));
                    }
                    let Found::Item(home, item) = root.resolve(module, &path, DEPTH)? else { return None };
                    self.places.get(&(&home.path[..], tree::name_of(item)?)).cloned()
                });
                if let Some(place) = place {
                    self.modules.entry(place).or_default().push(made);
                }
            }
        }
    }
}

fn segments(path: &syn::Path) -> Vec<String> {
    path.segments.iter().map(|segment| segment.ident.to_string()).collect()
}

fn type_path(of: &Type) -> Option<Vec<String>> {
    match of {
        Type::Path(path) => Some(segments(&path.path)),
        Type::Reference(reference) => type_path(&reference.elem),
        _ => None,
    }
}

fn public_interface() -> String {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let root = Module::read(&source.join("lib.rs"), &source, Vec::new());
    let mut shown = VisibleItems::default();
    shown.module(&root, &root, &[]);
    shown.tables(&root);
    shown.implementations(&root);
    let mut text = String::new();
    for (path, items) in shown.modules {
        let mut items: Vec<_> = items.into_iter().map(|item| skeleton::print(vec![item])).collect();
        // The items are sorted by text, so that the file does not change when an item moves within its module.
        items.sort();
        items.dedup();
        text += &format!("// {path}\n\n{}\n", items.concat());
    }
    text
}

#[test]
fn the_public_interface_is_the_recorded_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/docs/public-api.txt");
    let now = public_interface();
    if std::env::var_os(UPDATE).is_some() {
        std::fs::write(&path, &now).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    let line = |text: &str, index: usize| text.lines().nth(index).map(str::to_owned);
    let same = kept.lines().zip(now.lines()).take_while(|(kept, now)| kept == now).count();
    let difference = (line(&kept, same), line(&now, same));
    assert!(
        kept == now,
        "the public interface has changed, first after line {same} (kept, now): {difference:?}; if it is meant to, run this test with \
         {UPDATE}=1 and put it into the CHANGELOG"
    );
}
