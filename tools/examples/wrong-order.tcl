# The registers of wrong-order.rhai in GTKWave: gtkwave run.vcd -S tools/examples/wrong-order.tcl (docs/guide/debugging.md).
set node line.node2
gtkwave::addSignalsFromList [list drives.sync \
    $node.a_CONTROLWORD_SL_1 $node.a_STEUREG_CONTROLWORD_1 $node.a_STEUREG_CONTROLWORD_1_text \
    drives.slot drives.data drives.frame]
gtkwave::setZoomRangeTimes 106000 122000
