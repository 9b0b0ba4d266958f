"""Examples of the help texts, which run in a checkout, by module and function of the command."""

from __future__ import annotations

EXAMPLES = {
    "answer.identify": """\
tanteo identify examples/readings/bracket_left.csv --parts examples/parts""",
    "answer.locate": """\
tanteo locate examples/readings/bracket_left.csv --need 0.5mm \\
    --part examples/parts/bracket_left.step""",
    "following.next_reading": """\
tanteo next examples/readings/step_not_felt.csv --parts examples/parts""",
    "plan.plan": """\
tanteo plan --part examples/parts/bracket_left.step --goal 0.5mm --sd 0.1mm \\
    --pose-prior '400,200,0mm 0,0,90deg +- 5mm 3deg'""",
    "see.see": """\
tanteo see examples/images/three_parts.png --parts examples/parts \\
    --camera examples/images/camera.yaml --marks examples/images/marks.csv""",
    "probe.probe": """\
tanteo probe --machine fake:grbl --part examples/parts/bracket_left.step \\
    --goal 0.3mm --sd 0.02mm""",
    "cell.check_cell": """\
tanteo check-cell examples/readings/clamp_ball_tip.csv \\
    --part examples/parts/clamp.step --tip-sd 2,2,2mm""",
    "sense_part.sense_part": """\
tanteo sense part --scene examples/scenes/part_unknown.toml \\
    --parts examples/parts --goal 2mm""",
    "sense.sense_plane": """\
tanteo sense plane --scene examples/scenes/bracket.toml""",
    "part.show": """\
tanteo part show examples/parts/wedge.step""",
    "sensor.show_preset": """\
tanteo sensor show vl53l1x""",
    "sensor.fit": """\
tanteo sensor fit examples/readings/plane_log.csv \\
    --rig examples/readings/tof_rig.toml""",
    "catalogue.build": """\
tanteo catalogue build examples/parts --out parts.catalogue""",
    "demo.demo": """\
tanteo demo --no-open""",
    "bench.bench": """\
tanteo bench points --scenes 5""",
    "view.view": """\
tanteo view --scene examples/scenes/part_unknown.toml \\
    --parts examples/parts --goal 2mm""",
}
"""Command lines, continued as a shell continues them."""
