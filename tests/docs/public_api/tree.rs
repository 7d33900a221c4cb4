//! The library's modules as in the sources, and the meaning of a name in each of them.

use std::fs;
use std::path::Path;
use syn::{Attribute, Item, UseTree, Visibility};

/// A module, with its submodules.
pub(crate) struct Module {
    /// Path of the module from the library's root; the root has an empty path.
    pub path: Vec<String>,
    pub items: Vec<Item>,
    pub children: Vec<Module>,
}

/// Target of a name: a module, or an item of a module.
#[derive(Clone, Copy)]
pub(crate) enum Found<'a> {
    Module(&'a Module),
    Item(&'a Module, &'a Item),
}

/// Result of one branch of a `use`: a name for a path, or all names of a module.
pub(crate) struct Import {
    pub name: Option<String>,
    pub path: Vec<String>,
}

impl Module {
    /// Reads the module in `file`; its submodules are in `directory`.
    pub(crate) fn read(file: &Path, directory: &Path, path: Vec<String>) -> Module {
        let text = fs::read_to_string(file).unwrap();
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let items: Vec<_> = parsed.items.into_iter().filter(|item| !is_hidden(attributes(item))).collect();
        let mut children = Vec::new();
        for item in &items {
            let Item::Mod(module) = item else { continue };
            let name = module.ident.to_string();
            let path = [path.clone(), vec![name.clone()]].concat();
            let below = directory.join(&name);
            if let Some((_, items)) = &module.content {
                let items = items.iter().filter(|item| !is_hidden(attributes(item))).cloned().collect();
                children.push(Module { path, items, children: Vec::new() });
            } else if below.join("mod.rs").exists() {
                children.push(Module::read(&below.join("mod.rs"), &below, path));
            } else {
                children.push(Module::read(&below.with_extension("rs"), &below, path));
            }
        }
        Module { path, items, children }
    }

    pub(crate) fn child(&self, name: &str) -> Option<&Module> {
        self.children.iter().find(|child| child.path.last().is_some_and(|last| last == name))
    }

    /// Returns this module and all modules below it.
    pub(crate) fn all(&self) -> Vec<&Module> {
        [self].into_iter().chain(self.children.iter().flat_map(Module::all)).collect()
    }

    fn at(&self, path: &[String]) -> &Module {
        path.iter().fold(self, |module, name| module.child(name).expect("a module that was read"))
    }

    /// Resolves `path` in `scope`; `self` is the root. Returns `None` if the path leads out of the library.
    pub(crate) fn resolve<'a>(&'a self, scope: &'a Module, path: &[String], depth: u8) -> Option<Found<'a>> {
        let mut found = Found::Module(scope);
        for (index, name) in path.iter().enumerate() {
            let Found::Module(module) = found else { return None };
            found = match name.as_str() {
                "crate" => Found::Module(self),
                "self" => continue,
                "super" => Found::Module(self.at(&module.path[..module.path.len() - 1])),
                _ => self.look_up(module, name, index == 0, depth)?,
            };
        }
        Some(found)
    }

    /// Finds the item with this name in a module.
    fn look_up<'a>(&'a self, module: &'a Module, name: &str, is_first: bool, depth: u8) -> Option<Found<'a>> {
        if let Some(child) = module.child(name) {
            return Some(Found::Module(child));
        }
        if let Some(item) = module.items.iter().find(|item| name_of(item).is_some_and(|it| it == name)) {
            return Some(Found::Item(module, item));
        }
        let depth = depth.checked_sub(1)?;
        let imports = module.items.iter().filter_map(|item| match item {
            Item::Use(import) => Some(branches(&import.tree)),
            _ => None,
        });
        imports.flatten().find_map(|import| match &import.name {
            // A `use` that begins with the name that it imports would resolve itself without end.
            Some(own) if own == name && !(is_first && import.path.first() == Some(own)) => {
                self.resolve(module, &import.path, depth)
            }
            None => match self.resolve(module, &import.path, depth)? {
                Found::Module(all) if all.path != module.path => self.look_up(all, name, false, depth),
                _ => None,
            },
            Some(_) => None,
        })
    }
}

/// Returns the branches of a `use`.
pub(crate) fn branches(tree: &UseTree) -> Vec<Import> {
    fn walk(tree: &UseTree, path: &[String], found: &mut Vec<Import>) {
        let with = |name: String| [path, &[name]].concat();
        match tree {
            UseTree::Path(part) => walk(&part.tree, &with(part.ident.to_string()), found),
            UseTree::Name(name) if name.ident == "self" => {
                found.push(Import { name: path.last().cloned(), path: path.to_vec() });
            }
            UseTree::Name(name) => {
                found.push(Import { name: Some(name.ident.to_string()), path: with(name.ident.to_string()) });
            }
            UseTree::Rename(name) => {
                let path = if name.ident == "self" { path.to_vec() } else { with(name.ident.to_string()) };
                found.push(Import { name: Some(name.rename.to_string()), path });
            }
            UseTree::Glob(_) => found.push(Import { name: None, path: path.to_vec() }),
            UseTree::Group(group) => group.items.iter().for_each(|tree| walk(tree, path, found)),
        }
    }
    let mut found = Vec::new();
    walk(tree, &[], &mut found);
    found
}

/// Returns the name that an item defines.
pub(crate) fn name_of(item: &Item) -> Option<String> {
    Some(match item {
        Item::Const(it) => it.ident.to_string(),
        Item::Enum(it) => it.ident.to_string(),
        Item::Fn(it) => it.sig.ident.to_string(),
        Item::Static(it) => it.ident.to_string(),
        Item::Struct(it) => it.ident.to_string(),
        Item::Trait(it) => it.ident.to_string(),
        Item::Type(it) => it.ident.to_string(),
        Item::Union(it) => it.ident.to_string(),
        _ => return None,
    })
}

/// Returns whether the item is visible wherever its module is visible.
pub(crate) fn is_public(item: &Item) -> bool {
    let visibility = match item {
        Item::Const(it) => &it.vis,
        Item::Enum(it) => &it.vis,
        Item::Fn(it) => &it.vis,
        Item::Mod(it) => &it.vis,
        Item::Static(it) => &it.vis,
        Item::Struct(it) => &it.vis,
        Item::Trait(it) => &it.vis,
        Item::Type(it) => &it.vis,
        Item::Union(it) => &it.vis,
        Item::Use(it) => &it.vis,
        _ => return false,
    };
    matches!(visibility, Visibility::Public(_))
}

pub(crate) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(it) => &it.attrs,
        Item::Enum(it) => &it.attrs,
        Item::Fn(it) => &it.attrs,
        Item::Impl(it) => &it.attrs,
        Item::Macro(it) => &it.attrs,
        Item::Mod(it) => &it.attrs,
        Item::Static(it) => &it.attrs,
        Item::Struct(it) => &it.attrs,
        Item::Trait(it) => &it.attrs,
        Item::Type(it) => &it.attrs,
        Item::Union(it) => &it.attrs,
        Item::Use(it) => &it.attrs,
        _ => &[],
    }
}

/// True if the item is only for tests, or hidden from users.
fn is_hidden(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let syn::Meta::List(list) = &attribute.meta else { return false };
        let words = list.tokens.to_string();
        let mut words = words.split(|c: char| !c.is_alphanumeric() && c != '_');
        let hides = if list.path.is_ident("cfg") { &["test", "doctest", "loom"][..] } else { &["hidden"] };
        (list.path.is_ident("cfg") || list.path.is_ident("doc")) && words.any(|word| hides.contains(&word))
    })
}
