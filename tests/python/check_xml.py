"""Validates an XML file against schemas: those of CMSIS-SVD 1.3 from the package cmsis-svd, or a given one."""

import importlib.util
import pathlib
import sys

import xmlschema

if len(sys.argv) > 2:
    schemas = [pathlib.Path(sys.argv[2])]
else:
    package = importlib.util.find_spec("cmsis_svd").submodule_search_locations[0]
    schemas = sorted(pathlib.Path(package, "schemas").glob("CMSIS-SVD_1_3_*.xsd"))
assert schemas
for schema in schemas:
    for error in xmlschema.XMLSchema(str(schema)).iter_errors(sys.argv[1]):
        sys.exit(f"{schema.name}: {error.path}: {error.reason}")
print("valid by", len(schemas), "schemas")
