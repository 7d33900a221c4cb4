"""`commram lsp` as pytest-lsp, a client by another author, uses it.

Run with pytest-lsp; the variable COMMRAM names the program.
"""

import os
import pathlib

import pytest
import pytest_lsp
from lsprotocol import types
from pytest_lsp import ClientServerConfig, LanguageClient

PROGRAM = os.environ.get("COMMRAM", "commram")
SCENARIO = 'poke("node2.w_CPU_CONTRL", 1);\nwait("node2.w_OPTION_STATUS", 2, "1ms");\n'


@pytest_lsp.fixture(config=ClientServerConfig(server_command=[PROGRAM, "lsp"]))
async def client(lsp_client: LanguageClient, tmp_path_factory: pytest.TempPathFactory):
    root = tmp_path_factory.mktemp("project")
    params = types.InitializeParams(capabilities=types.ClientCapabilities(), root_uri=root.as_uri())
    result = await lsp_client.initialize_session(params)
    assert result.server_info is not None and result.server_info.name == "commram"
    lsp_client.root = root
    yield
    await lsp_client.shutdown_session()


def opened(client: LanguageClient, name: str, text: str) -> str:
    uri = (client.root / name).as_uri()
    item = types.TextDocumentItem(uri=uri, language_id="rhai", version=1, text=text)
    client.text_document_did_open(types.DidOpenTextDocumentParams(text_document=item))
    return uri


@pytest.mark.asyncio
async def test_a_wrong_register_is_underlined_and_corrected(client: LanguageClient):
    uri = opened(client, "one.rhai", SCENARIO)
    await client.wait_for_notification(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
    (mistake,) = client.diagnostics[uri]
    assert "did you mean" in mistake.message
    assert mistake.range.start == types.Position(line=0, character=6)

    # The range has UTF-16 units, which the client counts too.
    change = types.TextDocumentContentChangePartial(range=mistake.range, text="node2.w_CPU_CONTROL")
    document = types.VersionedTextDocumentIdentifier(uri=uri, version=2)
    client.text_document_did_change(
        types.DidChangeTextDocumentParams(text_document=document, content_changes=[change])
    )
    await client.wait_for_notification(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
    assert not client.diagnostics[uri]


@pytest.mark.asyncio
async def test_registers_are_completed_and_described(client: LanguageClient):
    uri = opened(client, "two.rhai", SCENARIO)
    document = types.TextDocumentIdentifier(uri=uri)
    position = types.Position(line=1, character=12)
    found = await client.text_document_completion_async(types.CompletionParams(document, position))
    assert "node2.w_OPTION_STATUS" in [item.label for item in found.items]
    about = await client.text_document_hover_async(types.HoverParams(document, position))
    assert "%MW3.200002" in about.contents.value
    help = await client.text_document_signature_help_async(
        types.SignatureHelpParams(document, types.Position(line=1, character=30))
    )
    assert help.active_parameter == 1


@pytest.mark.asyncio
async def test_a_function_is_renamed_in_the_scripts_that_import_it(client: LanguageClient):
    root: pathlib.Path = client.root
    (root / "user.rhai").write_text('import "part" as part;\npart::start();\n')
    uri = opened(client, "part.rhai", "fn start() {}\n")
    params = types.RenameParams(
        text_document=types.TextDocumentIdentifier(uri=uri), position=types.Position(0, 4), new_name="begin"
    )
    edit = await client.text_document_rename_async(params)
    assert {pathlib.PurePosixPath(name).name for name in edit.changes} == {"part.rhai", "user.rhai"}


@pytest.mark.asyncio
async def test_a_plant_links_to_its_device_and_to_existing_files_only(client: LanguageClient):
    root: pathlib.Path = client.root
    (root / "cards" / "counter").mkdir(parents=True)
    (root / "cards" / "counter" / "device.toml").write_text('name = "counter"\n')
    text = '[[device]]\nkind = "./cards/counter"\n[[device]]\nkind = "./cards/none"\n'
    uri = opened(client, "plant.toml", text)
    params = types.DocumentLinkParams(text_document=types.TextDocumentIdentifier(uri=uri))
    links = await client.text_document_document_link_async(params)
    targets = {link.target.split("#")[0].removeprefix("file://") for link in links}
    assert str(root / "cards" / "counter" / "device.toml") in targets
    assert all(pathlib.Path(target).is_file() for target in targets)
    (folder,) = [link for link in links if link.target.endswith("/counter/device.toml")]
    assert folder.range == types.Range(types.Position(1, 8), types.Position(1, 23))
