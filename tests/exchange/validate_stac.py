"""Validates a STAC Item offline: core schemas as pystac ships them, extensions by the rules beside this file."""

import json
import pathlib
import sys
import warnings

warnings.filterwarnings("ignore", category=DeprecationWarning)

import pystac  # noqa: E402
from stac_validator.stac_validator import StacValidate  # noqa: E402

item = pathlib.Path(sys.argv[1])
schemas = pathlib.Path(pystac.__file__).parent / "validation" / "jsonschemas"
places = {}
for path in schemas.rglob("*.json"):
    address = json.loads(path.read_text()).get("$id")
    if address:
        places[address.rstrip("#")] = str(path)
        # One published schema spells its own address without the dot.
        if not address.rstrip("#").endswith(".json"):
            places[address.rsplit("/", 1)[0] + "/" + path.name] = str(path)
rules = pathlib.Path(__file__).parent / "stac_extensions"
for address in json.loads(item.read_text())["stac_extensions"]:
    places[address] = str(rules / (address.split("/")[3] + ".json"))

validator = StacValidate(str(item), schema_map=places)
if not validator.run():
    sys.exit(json.dumps(validator.message, indent=1))
read = pystac.Item.from_file(str(item))
print(json.dumps({
    "id": read.id,
    "bbox": read.bbox,
    "geometry": read.geometry["type"],
    "assets": {key: asset.get_absolute_href() for key, asset in read.assets.items()},
    "validated": validator.message[0]["schema"],
}))
