"""Completion, attributes, views."""

import subprocess
import sys

import commram
import pytest

numpy = pytest.importorskip("numpy")


def test_completion_offers_names(emulator):
    keys = emulator._ipython_key_completions_()
    assert "node2.a_RD_BMARRAY[31][15]" in keys and len(keys) == len(set(keys))
    assert {"node1", "node2", "baps", "poke"} <= set(dir(emulator))
    assert "w_CPU_CONTROL" in dir(emulator.node2) and "a_WR_VALUE" in dir(emulator.node2)
    assert "b_CFG_RDC1_WORD0" in dir(emulator.node2.a_CFG_RDC_WORD[1])
    assert emulator.snapshot("node2")._ipython_key_completions_()


def test_attributes_are_registers(emulator):
    node = emulator.node2
    node.b_BT_0, node.a_SL_TYP[1], node._CFG_WRC_WORD.b_CFG_WRC1_WORD0 = 3, 1, 0x0D
    assert emulator["node2.b_BT_0"] == node.b_BT_0 == 3
    assert emulator["node2.a_SL_TYP[1]"] == node.a_SL_TYP[1] == 1
    assert emulator["node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0"] == 0x0D
    assert len(node.a_RD_BMARRAY) == 32 and list(node.a_SL_TYP)[1] == 1
    for wrong in (32, -1):
        with pytest.raises(IndexError, match=r"has 32 elements"):
            node.a_SL_TYP[wrong]
    with pytest.raises(TypeError):
        node.a_SL_TYP["1"]
    with pytest.raises(TypeError, match="is not one register"):
        node.a_SL_TYP = 1
    with pytest.raises(AttributeError):
        node.b_BT_7 = 1


def test_arrays_are_seen_where_they_are(emulator):
    values, rows = emulator.array("node2.a_WR_VALUE"), emulator.array("node2.a_RD_BMARRAY")
    assert values.dtype == numpy.int32 and rows.shape == (32, 16) and values.flags.writeable
    values[3] = -7
    assert emulator["node2.a_WR_VALUE[3]"] == -7
    emulator["node2.a_RD_BMARRAY[1][2]"] = 5
    assert rows[1, 2] == 5 and emulator.array("node2.a_RD_BMARRAY[1]")[2] == 5
    view = emulator.view("node2.a_RD_BMARRAY")
    assert view[1, 2] == 5 and view.shape == (32, 16) and view.format == "i"
    assert emulator.view("node2.a_RD_BMARRAY[1]")[2] == 5
    # The elements are not adjacent: between them are the other members of the structures.
    words = emulator.array("node2.a_CFG_RDC_WORD.b_CFG_RDC1_WORD0")
    emulator["node2.a_CFG_RDC_WORD[4].b_CFG_RDC1_WORD0"] = 9
    assert words[4] == 9 and emulator.view("node2.a_CFG_RDC_WORD.b_CFG_RDC1_WORD0")[4] == 9
    assert numpy.asarray(emulator.node2.a_WR_VALUE)[3] == -7
    assert numpy.asarray(emulator.node2.a_WR_VALUE, dtype=float)[3] == -7.0
    for wrong in ("node2.a_WR", "node2", "node2.a_WR_VALUE[1][1]"):
        with pytest.raises(KeyError, match="no such array"):
            emulator.array(wrong)


def test_values_of_numpy_are_integers(emulator):
    emulator["node2.b_BT_0"] = numpy.uint8(7)
    assert emulator["node2.b_BT_0"] == 7
    for wrong in (numpy.float64(1.0), numpy.bool_(True)):
        with pytest.raises(TypeError):
            emulator["node2.b_BT_0"] = wrong


def test_numpy_may_be_missing():
    code = (
        "import sys; sys.modules['numpy'] = None\n"
        "import commram\n"
        "plant = commram.Emulator()\n"
        "assert plant.view('node2.a_WR_VALUE')[0] == 0\n"
        "try: plant.array('node2.a_WR_VALUE')\n"
        "except ImportError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install numpy" in done.stdout


def test_registers_are_described():
    found = commram.register("node2.w_OPTION_STATUS")
    assert (found.iec_address, found.type, found.code, found.width) == ("%MW3.200002", "WORD", "H", 2)
    assert found.owner == "firmware" and found.address == 200002 and "D-02" in found.provenance
    assert found.decode(2).startswith("waiting for")
    assert commram.names("node2")[0].startswith("node2.")
    with pytest.raises(KeyError):
        commram.register("node2.w_OPTION")


def test_enumerations_are_integers(emulator):
    assert commram.SEND.DATA_WRITTEN_TO_BE_SENT == 5
    locked = commram.STAT_SL.RESPONSE | commram.STAT_SL.SYNCHRONIZED
    emulator["node2.a_STAT_SL[1]"] = locked
    assert emulator["node2.a_STAT_SL[1]"] == 3
    assert "SEND" in dir(commram) and commram.ClockMode.STEPPED.name == "STEPPED"
    with pytest.raises(AttributeError):
        commram.SENT
