"""Reads exports of a device with a hostile text as the description of its register `w_OUT`: FILE.rdl FILE.py FILE.csv TEXT."""

import csv
import sys

from systemrdl import RDLCompiler

rdl, module, table, hostile = sys.argv[1:]

compiler = RDLCompiler()
compiler.compile_file(rdl)
top = compiler.elaborate().top
register = top.find_by_path("_data.w_OUT")
# The exporter inserts blanks and changes backquotes, and the tag of a bracket is [lb].
shown = "".join(register.get_property("desc").replace("[lb]", "[").split())
assert "".join(hostile.replace("`", "'").split()) in shown, shown
for node in (top, register):
    page = node.get_html_desc()
    assert not any(tag in page for tag in ("<script", "<x", "<a ", "<!--", "<%")), page

names = {}
with open(module, encoding="utf-8") as file:
    exec(compile(file.read(), module, "exec"), names)
assert any(hostile in row for rows in names["_STRUCTURES"].values() for row in rows)

with open(table, encoding="utf-8", newline="") as file:
    docs = [row["doc"] for row in csv.DictReader(file) if row["name"] == "data.w_OUT"]
assert docs[0].removeprefix("'").startswith(hostile), docs
assert (docs[0][0] == "'") == (hostile[0] in "=+-@"), docs
print("3 files")
