//! The language server: the open documents, and the answer to each message of the editor.

use super::complete::{self, Proposal};
use super::document::Document;
use super::judge::{self, Judge};
use super::links::{self, Link};
use super::pages::{PagePlace, Pages};
use super::place::{path_of, uri_of};
use super::scenario::ScriptView;
use super::scenes::{PlantName, Scene, Scenes};
use super::tables::{self, TableKind};
use super::{definition, hover, rename, signature};
use crate::devices::folder::edited;
use crate::input_file;
use crate::script::check::Checker;
use core::ops::Range;
use lsp_server::{ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types as lsp;
use lsp_types::{TextDocumentPositionParams, TextEdit, Uri};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// What the caller does after a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    Continue,
    /// The editor has ended the server.
    End,
    /// The editor has ended the server without the request `shutdown`.
    EndWithoutShutdown,
}

/// A refused request: the code of the protocol, and the reason.
type Refusal = (ErrorCode, String);

/// Ranges in a file.
type Places = (Uri, Vec<lsp::Range>);

/// The documents that the editor has open, and the plants and scripts that they name.
pub(super) struct Server {
    documents: BTreeMap<String, Document>,
    /// Documents that have changed since they were last checked.
    changed: BTreeSet<String>,
    scenes: Scenes,
    checker: Checker,
    pages: Pages,
    /// Folders that the editor has open.
    roots: Vec<PathBuf>,
    is_initialized: bool,
    is_shut_down: bool,
}

impl Server {
    pub(super) fn new() -> Self {
        Self {
            documents: BTreeMap::new(),
            changed: BTreeSet::new(),
            scenes: Scenes::default(),
            checker: Checker::new(),
            pages: Pages::of_program(),
            roots: Vec::new(),
            is_initialized: false,
            is_shut_down: false,
        }
    }

    /// Handles a message. Adds the answer to a request to `answers`.
    pub(super) fn take(&mut self, message: Message, answers: &mut Vec<Message>) -> Next {
        match message {
            Message::Request(request) => {
                let Request { id, method, params } = request;
                answers.push(response(id, self.answer(&method, params)).into());
                Next::Continue
            }
            Message::Notification(notification) => self.note(notification, answers),
            // The server sends no requests, so it ignores responses.
            Message::Response(_) => Next::Continue,
        }
    }

    /// Checks the documents that have changed, and adds their errors to `answers`.
    pub(super) fn settle(&mut self, answers: &mut Vec<Message>) {
        for uri in core::mem::take(&mut self.changed) {
            let Some(document) = self.documents.get(&uri) else { continue };
            let (uri, version) = (document.uri.clone(), Some(document.version));
            let diagnostics = self.diagnostics(uri.as_str());
            publish(answers, lsp::PublishDiagnosticsParams { uri, version, diagnostics });
        }
    }

    fn answer(&mut self, method: &str, params: Value) -> Result<Value, Refusal> {
        if self.is_shut_down {
            return Err((ErrorCode::InvalidRequest, "the server has shut down".to_owned()));
        }
        if !self.is_initialized && method != "initialize" {
            return Err((ErrorCode::ServerNotInitialized, "send `initialize` first".to_owned()));
        }
        match method {
            "initialize" => self.initialize(parsed(params)?),
            "shutdown" => {
                self.is_shut_down = true;
                Ok(Value::Null)
            }
            "textDocument/completion" => shown(&self.completion(&parsed(params)?)),
            "textDocument/hover" => shown(&self.hover(&parsed(params)?)),
            "textDocument/signatureHelp" => shown(&self.signature_help(&parsed(params)?)),
            "textDocument/definition" => shown(&self.definition(&parsed(params)?)),
            "textDocument/documentLink" => shown(&self.links(&parsed(params)?)),
            "textDocument/references" => shown(&self.references(&parsed(params)?)),
            "textDocument/prepareRename" => shown(&self.prepare_rename(&parsed(params)?)),
            "textDocument/rename" => shown(&self.rename(&parsed(params)?)?),
            other => Err((ErrorCode::MethodNotFound, format!("this server has no `{other}`"))),
        }
    }

    fn initialize(&mut self, params: lsp::InitializeParams) -> Result<Value, Refusal> {
        self.is_initialized = true;
        let folders = params.workspace_folders.unwrap_or_default();
        self.roots = folders.iter().map(|folder| path_of(&folder.uri)).collect();
        #[expect(deprecated, reason = "older editors have one folder only")]
        if let Some(root) = params.root_uri.filter(|_| self.roots.is_empty()) {
            self.roots.push(path_of(&root));
        }
        let capabilities = lsp::ServerCapabilities {
            position_encoding: Some(lsp::PositionEncodingKind::UTF16),
            text_document_sync: Some(lsp::TextDocumentSyncCapability::Options(
                lsp::TextDocumentSyncOptions {
                    open_close: Some(true),
                    change: Some(lsp::TextDocumentSyncKind::INCREMENTAL),
                    save: Some(lsp::TextDocumentSyncSaveOptions::Supported(true)),
                    ..lsp::TextDocumentSyncOptions::default()
                },
            )),
            completion_provider: Some(lsp::CompletionOptions {
                trigger_characters: Some(["\"", ".", "[", " ", "=", ":"].map(str::to_owned).to_vec()),
                ..lsp::CompletionOptions::default()
            }),
            hover_provider: Some(lsp::HoverProviderCapability::Simple(true)),
            signature_help_provider: Some(lsp::SignatureHelpOptions {
                trigger_characters: Some(["(", ","].map(str::to_owned).to_vec()),
                ..lsp::SignatureHelpOptions::default()
            }),
            definition_provider: Some(lsp::OneOf::Left(true)),
            references_provider: Some(lsp::OneOf::Left(true)),
            document_link_provider: Some(lsp::DocumentLinkOptions {
                resolve_provider: Some(false),
                work_done_progress_options: lsp::WorkDoneProgressOptions::default(),
            }),
            rename_provider: Some(lsp::OneOf::Right(lsp::RenameOptions {
                prepare_provider: Some(true),
                work_done_progress_options: lsp::WorkDoneProgressOptions::default(),
            })),
            ..lsp::ServerCapabilities::default()
        };
        let server = json!({ "name": "commram", "version": env!("CARGO_PKG_VERSION") });
        Ok(json!({ "capabilities": capabilities, "serverInfo": server }))
    }

    fn note(&mut self, notification: Notification, answers: &mut Vec<Message>) -> Next {
        let Notification { method, params } = notification;
        match method.as_str() {
            "exit" if self.is_shut_down => return Next::End,
            "exit" => return Next::EndWithoutShutdown,
            "textDocument/didOpen" => {
                if let Ok(lsp::DidOpenTextDocumentParams { text_document }) = parsed(params) {
                    let lsp::TextDocumentItem { uri, version, text, .. } = text_document;
                    self.documents.insert(uri.as_str().to_owned(), Document::new(uri, version, text));
                    self.judge_all();
                }
            }
            "textDocument/didChange" => {
                if let Ok(lsp::DidChangeTextDocumentParams { text_document, content_changes }) =
                    parsed(params)
                    && let Some(document) = self.documents.get_mut(text_document.uri.as_str())
                {
                    document.change(text_document.version, content_changes);
                    let is_script = document.is_script();
                    self.changed.insert(text_document.uri.as_str().to_owned());
                    // Scenarios depend on plant files: a change of another file can change the errors of scenarios.
                    if !is_script {
                        self.judge_all();
                    }
                }
            }
            // A saved file may belong to the folder of a device.
            "textDocument/didSave" | "workspace/didChangeWatchedFiles" => self.judge_all(),
            "textDocument/didClose" => {
                if let Ok(lsp::DidCloseTextDocumentParams {
                    text_document: lsp::TextDocumentIdentifier { uri },
                }) = parsed(params)
                    && self.documents.remove(uri.as_str()).is_some()
                {
                    self.judge_all();
                    publish(
                        answers,
                        lsp::PublishDiagnosticsParams { uri, version: None, diagnostics: Vec::new() },
                    );
                }
            }
            _ => {}
        }
        Next::Continue
    }

    fn judge_all(&mut self) {
        self.changed.extend(self.documents.keys().cloned());
    }

    fn diagnostics(&mut self, uri: &str) -> Vec<lsp::Diagnostic> {
        let Self { documents, scenes, checker, .. } = self;
        let Some(document) = documents.get(uri) else { return Vec::new() };
        if document.is_too_long() {
            return vec![judge::too_long(document).shown(document)];
        }
        if document.is_table() {
            let Some(kind) = TableKind::of(document) else { return Vec::new() };
            let mistakes = kind.mistakes(document, |dir| texts_below(documents, dir));
            return mistakes.into_iter().map(|mistake| mistake.shown(document)).collect();
        }
        if !document.is_script() {
            return Vec::new();
        }
        let view = ScriptView::of(document);
        let (scene, refusal) = match scene_of(&view, documents, scenes) {
            None => (None, None),
            Some(Ok(scene)) => (Some(scene), None),
            Some(Err(message)) => (None, Some(message.to_owned())),
        };
        let read = |path: &Path| text_of(documents, path);
        let mut judge = Judge { view: &view, checker, scene, refusal, read: &read };
        let mut mistakes = judge.mistakes(document);
        if let Some((dir, name)) = view.part_of_firmware() {
            // A script of a device is checked by the rules of device folders, not by those of scenarios.
            mistakes = tables::of_folder(document, edited::check_script(dir, name, view.text));
        }
        mistakes.into_iter().map(|mistake| mistake.shown(document)).collect()
    }

    /// Calls `act` with the script at a position, the plant of the script, and the position in bytes.
    fn at<T>(
        &mut self,
        place: &TextDocumentPositionParams,
        act: impl FnOnce(
            &Document,
            &ScriptView<'_>,
            Option<&mut Scene>,
            &dyn Fn(&Path) -> Option<String>,
            usize,
        ) -> Option<T>,
    ) -> Option<T> {
        let Self { documents, scenes, .. } = self;
        let document = documents.get(place.text_document.uri.as_str())?;
        if !document.is_script() || document.is_too_long() {
            return None;
        }
        let view = ScriptView::of(document);
        // A script that only defines functions gets the completions of the built-in plant.
        let scene = match view.plant() {
            Some(_) => scene_of(&view, documents, scenes).and_then(Result::ok),
            None => scenes.get(&PlantName::BuiltIn, |_| None).ok(),
        };
        let read = |path: &Path| text_of(documents, path);
        act(document, &view, scene, &read, document.text.offset(place.position))
    }

    /// Calls `act` with the TOML file at a position, and the position in bytes.
    fn at_table<T>(
        &self,
        place: &TextDocumentPositionParams,
        act: impl FnOnce(&Document, &TableKind, usize) -> Option<T>,
    ) -> Option<T> {
        let document = self.documents.get(place.text_document.uri.as_str())?;
        if !document.is_table() || document.is_too_long() {
            return None;
        }
        act(document, &TableKind::of(document)?, document.text.offset(place.position))
    }

    fn completion(&mut self, params: &lsp::CompletionParams) -> Option<lsp::CompletionList> {
        let place = &params.text_document_position;
        let in_table = self.at_table(place, |document, kind, offset| {
            let (proposals, range) = kind.proposals(document, offset);
            Some((proposals, document.text.range(&range)))
        });
        let found = self.at(place, |document, view, scene, _, offset| {
            let (proposals, range) = complete::at(view, scene, offset);
            Some((proposals, document.text.range(&range)))
        });
        let (proposals, range) = found.or(in_table)?;
        // If the user has typed a blank or a sign, the request is only for names in a text. The verbs are left out,
        // because the list would become too long.
        let by_sign = params
            .context
            .as_ref()
            .is_some_and(|context| context.trigger_kind == lsp::CompletionTriggerKind::TRIGGER_CHARACTER);
        let proposals =
            if by_sign { proposals.into_iter().filter(|it| !it.is_word()).collect() } else { proposals };
        let items = (0..).zip(proposals).map(|(place, proposal)| item(proposal, range, place)).collect();
        // The proposals in a text depend on the typed part: an index, for example, follows only an array.
        Some(lsp::CompletionList { is_incomplete: true, items })
    }

    fn hover(&mut self, params: &lsp::HoverParams) -> Option<lsp::Hover> {
        let place = &params.text_document_position_params;
        let in_table = self.at_table(place, |document, kind, offset| {
            let (about, range) = kind.description(document, offset)?;
            Some((about, document.text.range(&range)))
        });
        let found = self.at(place, |document, view, scene, _, offset| {
            let (about, range) = hover::at(view, scene, offset)?;
            Some((about, document.text.range(&range)))
        });
        let (value, range) = found.or(in_table)?;
        let contents = lsp::MarkupContent { kind: lsp::MarkupKind::Markdown, value };
        Some(lsp::Hover { contents: lsp::HoverContents::Markup(contents), range: Some(range) })
    }

    fn signature_help(&mut self, params: &lsp::SignatureHelpParams) -> Option<lsp::SignatureHelp> {
        let place = &params.text_document_position_params;
        self.at(place, |_, view, _, _, offset| signature::help(view, offset))
    }

    fn definition(&mut self, params: &lsp::GotoDefinitionParams) -> Option<lsp::Location> {
        self.at(&params.text_document_position_params, |document, view, scene, read, offset| {
            let target = definition::at(view, &document.text, scene, read, offset)?;
            let uri = target.path.map_or_else(|| Some(document.uri.clone()), |path| uri_of(&path))?;
            Some(lsp::Location::new(uri, target.range))
        })
    }

    fn links(&self, params: &lsp::DocumentLinkParams) -> Option<Vec<lsp::DocumentLink>> {
        let document = self.documents.get(params.text_document.uri.as_str())?;
        if document.is_too_long() {
            return None;
        }
        let found = match TableKind::of(document).filter(|_| document.is_table()) {
            Some(kind) => links::of_table(document, &kind, &self.pages),
            None if document.is_script() => links::of_script(&ScriptView::of(document)),
            None => return None,
        };
        let link = |Link { range, target: PagePlace { file, line } }: Link| {
            let mut target = uri_of(&file)?.as_str().to_owned();
            // Editors go to a line of a text by this fragment.
            target.extend(line.map(|line| format!("#L{line}")));
            Some(lsp::DocumentLink {
                range: document.text.range(&range),
                target: Some(target.parse().ok()?),
                tooltip: Some(self.pages.name_of(&file).display().to_string()),
                data: None,
            })
        };
        Some(found.into_iter().filter_map(link).collect())
    }

    fn references(&mut self, params: &lsp::ReferenceParams) -> Option<Vec<lsp::Location>> {
        let places = self.places(&params.text_document_position)?;
        let location = |(uri, ranges): Places| {
            ranges.into_iter().map(move |range| lsp::Location::new(uri.clone(), range)).collect::<Vec<_>>()
        };
        Some(places.into_iter().flat_map(location).collect())
    }

    fn prepare_rename(&mut self, place: &TextDocumentPositionParams) -> Option<lsp::PrepareRenameResponse> {
        self.at(place, |document, view, _, _, offset| {
            let (placeholder, range) = rename::function_at(view, offset)?;
            let range = document.text.range(&range);
            Some(lsp::PrepareRenameResponse::RangeWithPlaceholder { range, placeholder })
        })
    }

    fn rename(&mut self, params: &lsp::RenameParams) -> Result<Option<lsp::WorkspaceEdit>, Refusal> {
        let place = &params.text_document_position;
        let checked = self.at(place, |_, view, _, _, _| Some(rename::check_name(view, &params.new_name)));
        checked.unwrap_or(Ok(())).map_err(|reason| (ErrorCode::RequestFailed, reason))?;
        let Some(places) = self.places(place) else { return Ok(None) };
        let edit = |range| TextEdit { range, new_text: params.new_name.clone() };
        // The protocol requires a map with URIs as keys.
        #[allow(clippy::mutable_key_type, reason = "nothing changes the keys")]
        let changes: HashMap<_, _> =
            places.into_iter().map(|(uri, ranges)| (uri, ranges.into_iter().map(edit).collect())).collect();
        Ok(Some(lsp::WorkspaceEdit { changes: Some(changes), ..lsp::WorkspaceEdit::default() }))
    }

    /// Returns all occurrences of the function of this script at a position: in its own script, and in scripts that
    /// import it.
    fn places(&mut self, place: &TextDocumentPositionParams) -> Option<Vec<Places>> {
        let (name, own) = self.at(place, |document, view, _, _, offset| {
            let (name, _) = rename::function_at(view, offset)?;
            let own = rename::places(view.text, view.outline, &name, None);
            Some((name, (document.uri.clone(), document.path.clone(), ranges(document, &own))))
        })?;
        let (uri, path, own) = own;
        let mut all = vec![(uri, own)];
        let mut add = |other: &Document| {
            let found = rename::places_of_import(other, &path, &name);
            if !found.is_empty() {
                all.push((other.uri.clone(), ranges(other, &found)));
            }
        };
        let open: BTreeSet<_> = self.documents.values().map(|document| document.path.as_path()).collect();
        self.documents.values().filter(|document| document.is_script()).for_each(&mut add);
        for file in self.roots.iter().flat_map(|root| rename::scripts_below(root)) {
            if open.contains(file.as_path()) {
                continue;
            }
            let text = input_file::read(&file, input_file::LONGEST_SCRIPT).ok();
            if let Some((text, uri)) = text.zip(uri_of(&file)) {
                add(&Document::new(uri, 0, text));
            }
        }
        Some(all)
    }
}

/// Returns the plant of a script, or the reason why the plant is refused; `None` if the script does not determine its
/// plant.
fn scene_of<'a>(
    view: &ScriptView<'_>,
    documents: &BTreeMap<String, Document>,
    scenes: &'a mut Scenes,
) -> Option<Result<&'a mut Scene, &'a str>> {
    let open = |path: &Path| open_document(documents, path).map(|document| document.text.as_str().to_owned());
    Some(scenes.get(&view.plant()?, open))
}

/// Returns the open files of a folder, with their texts.
fn texts_below(documents: &BTreeMap<String, Document>, dir: &Path) -> BTreeMap<PathBuf, String> {
    let tables =
        documents.values().filter(|document| document.is_table() && document.path.parent() == Some(dir));
    tables.map(|document| (document.path.clone(), document.text.as_str().to_owned())).collect()
}

fn open_document<'a>(documents: &'a BTreeMap<String, Document>, path: &Path) -> Option<&'a Document> {
    documents.values().find(|document| document.path == path)
}

/// Returns the text of a script from the editor. If the editor has not opened it, returns the text of the file.
fn text_of(documents: &BTreeMap<String, Document>, path: &Path) -> Option<String> {
    let open = open_document(documents, path).map(|document| document.text.as_str().to_owned());
    open.or_else(|| input_file::read(path, input_file::LONGEST_SCRIPT).ok())
}

fn ranges(document: &Document, places: &[Range<usize>]) -> Vec<lsp::Range> {
    places.iter().map(|place| document.text.range(place)).collect()
}

fn item(proposal: Proposal, range: lsp::Range, place: usize) -> lsp::CompletionItem {
    let Proposal { label, detail, about, kind } = proposal;
    lsp::CompletionItem {
        // Sorts registers by their position in the register map, instead of by their names.
        sort_text: Some(format!("{place:05}")),
        filter_text: Some(label.clone()),
        text_edit: Some(lsp::CompletionTextEdit::Edit(TextEdit { range, new_text: label.clone() })),
        label,
        detail: (!detail.is_empty()).then_some(detail),
        documentation: (!about.is_empty()).then_some(lsp::Documentation::String(about)),
        kind: Some(kind),
        ..lsp::CompletionItem::default()
    }
}

fn publish(answers: &mut Vec<Message>, params: lsp::PublishDiagnosticsParams) {
    // The conversion cannot fail: the parameters contain no maps.
    let params = serde_json::to_value(params).unwrap_or_default();
    answers.push(Notification { method: "textDocument/publishDiagnostics".to_owned(), params }.into());
}

fn response(id: RequestId, result: Result<Value, Refusal>) -> Response {
    match result {
        Ok(value) => Response::new_ok(id, value),
        Err((code, message)) => Response::new_err(id, code as i32, message),
    }
}

/// # Errors
/// The parameters do not have the form that the request needs.
fn parsed<T: DeserializeOwned>(params: Value) -> Result<T, Refusal> {
    serde_json::from_value(params).map_err(|error| (ErrorCode::InvalidParams, error.to_string()))
}

fn shown(result: &impl Serialize) -> Result<Value, Refusal> {
    serde_json::to_value(result).map_err(|error| (ErrorCode::InternalError, error.to_string()))
}

/// Converts a position in bytes to a position of the protocol, for tests.
#[cfg(test)]
pub(super) fn position(text: &str, offset: usize) -> lsp::Position {
    super::text::Text::new(text.to_owned()).position(offset)
}
