//! Items without the parts that users do not see: bodies, private fields, comments.

use syn::parse::Parser;
use syn::{
    Attribute, Block, Expr, Field, Fields, File, ImplItem, Item, ItemImpl, Lit, TraitItem, Visibility,
};

/// Returns the text of items.
pub(crate) fn print(items: Vec<Item>) -> String {
    prettyplease::unparse(&File { shebang: None, attrs: Vec::new(), items })
}

/// Returns a public item as its users see it.
pub(crate) fn of(item: &Item) -> Item {
    let mut item = item.clone();
    match &mut item {
        Item::Const(it) => {
            keep_visible_attributes(&mut it.attrs);
            if !is_plain(&it.expr) {
                *it.expr = unknown();
            }
        }
        Item::Static(it) => {
            keep_visible_attributes(&mut it.attrs);
            *it.expr = unknown();
        }
        Item::Fn(it) => {
            keep_visible_attributes(&mut it.attrs);
            *it.block = nothing();
        }
        Item::Struct(it) => {
            keep_visible_attributes(&mut it.attrs);
            if strip_fields(&mut it.fields, false) {
                it.attrs.extend(Attribute::parse_outer.parse_str("#[with_private_fields]").unwrap());
            }
        }
        Item::Union(it) => {
            keep_visible_attributes(&mut it.attrs);
            it.fields.named.iter_mut().for_each(|field| keep_visible_attributes(&mut field.attrs));
        }
        Item::Enum(it) => {
            keep_visible_attributes(&mut it.attrs);
            for variant in &mut it.variants {
                keep_visible_attributes(&mut variant.attrs);
                strip_fields(&mut variant.fields, true);
            }
        }
        Item::Trait(it) => {
            keep_visible_attributes(&mut it.attrs);
            for part in &mut it.items {
                strip_trait_item(part);
            }
        }
        Item::Mod(it) => {
            keep_visible_attributes(&mut it.attrs);
            it.content = None;
            it.semi = Some(Default::default());
        }
        Item::Type(it) => keep_visible_attributes(&mut it.attrs),
        Item::Use(it) => keep_visible_attributes(&mut it.attrs),
        _ => {}
    }
    item
}

/// Returns the part of an implementation that users see: public functions and constants, or the trait. `None` if
/// there is no such part.
pub(crate) fn implementation(of: &ItemImpl) -> Option<Item> {
    let mut it = of.clone();
    keep_visible_attributes(&mut it.attrs);
    if it.trait_.is_some() {
        it.items.retain(|part| matches!(part, ImplItem::Type(_)));
        return Some(Item::Impl(it));
    }
    it.items.retain_mut(|part| match part {
        ImplItem::Fn(function) if is_public(&function.vis) => {
            keep_visible_attributes(&mut function.attrs);
            function.block = nothing();
            true
        }
        ImplItem::Const(constant) if is_public(&constant.vis) => {
            keep_visible_attributes(&mut constant.attrs);
            constant.expr = unknown();
            true
        }
        _ => false,
    });
    (!it.items.is_empty()).then_some(Item::Impl(it))
}

fn strip_trait_item(part: &mut TraitItem) {
    match part {
        TraitItem::Fn(function) => {
            keep_visible_attributes(&mut function.attrs);
            if function.default.is_some() {
                function.default = Some(nothing());
            }
        }
        TraitItem::Const(constant) => keep_visible_attributes(&mut constant.attrs),
        TraitItem::Type(of) => keep_visible_attributes(&mut of.attrs),
        _ => {}
    }
}

/// Removes private fields and returns whether there were any.
fn strip_fields(fields: &mut Fields, all_are_public: bool) -> bool {
    let strip = |field: &Field| {
        let mut field = field.clone();
        keep_visible_attributes(&mut field.attrs);
        (all_are_public || is_public(&field.vis)).then_some(field)
    };
    let before = fields.len();
    match fields {
        Fields::Named(named) => named.named = named.named.iter().filter_map(strip).collect(),
        Fields::Unnamed(unnamed) => unnamed.unnamed = unnamed.unnamed.iter().filter_map(strip).collect(),
        Fields::Unit => {}
    }
    fields.len() < before
}

/// Keeps the attributes that affect users.
fn keep_visible_attributes(attributes: &mut Vec<Attribute>) {
    let kept = ["cfg", "derive", "must_use", "non_exhaustive", "repr", "deprecated"];
    attributes.retain(|attribute| kept.iter().any(|name| attribute.path().is_ident(name)));
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

fn is_plain(value: &Expr) -> bool {
    matches!(value, Expr::Lit(literal) if !matches!(literal.lit, Lit::Str(_)))
}

fn nothing() -> Block {
    syn::parse_str("{}").unwrap()
}

fn unknown() -> Expr {
    syn::parse_str("_").unwrap()
}
