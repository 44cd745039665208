"""Run by a Python that has OpenSim: moves a model by a MOT, and finds its angles from a TRC by inverse kinematics.

Usage: read_in_opensim.py FOLDER OUT.json, where FOLDER has motion.osim, motion.mot and motion.trc.
"""

import json
import sys
from pathlib import Path

import opensim


def table(path):
    """Column -> values, and the times."""
    read = opensim.TimeSeriesTable(str(path))
    in_degrees = read.getTableMetaDataString("inDegrees")
    columns = {name: list(read.getDependentColumn(name).to_numpy()) for name in read.getColumnLabels()}
    return {"times": list(read.getIndependentColumn()), "columns": columns, "inDegrees": in_degrees}


def moved(folder):
    """Origins of all bodies (T, 3) [m] as the model stands at the instants of the MOT."""
    model = opensim.Model(str(folder / "motion.osim"))
    state = model.initSystem()
    motion = table(folder / "motion.mot")
    coordinates = {c.getName(): c for c in (model.getCoordinateSet().get(i) for i in range(model.getNumCoordinates()))}
    bodies = [model.getBodySet().get(i) for i in range(model.getNumBodies())]
    found = {body.getName(): [] for body in bodies}
    turning = {n for n, c in coordinates.items() if c.getMotionType() == opensim.Coordinate.Rotational}
    for row in range(len(motion["times"])):
        for name, values in motion["columns"].items():
            value = values[row] * (3.141592653589793 / 180.0 if name in turning else 1.0)
            coordinates[name].setValue(state, value, False)
        model.realizePosition(state)
        for body in bodies:
            place = body.getPositionInGround(state)
            found[body.getName()].append([place[axis] for axis in range(3)])
    return {"bodies": found, "mass": model.getTotalMass(state), "turning": sorted(turning)}


def analysed(folder):
    """Joint angles [deg] by OpenSim's own Kinematics analysis of the MOT."""
    tool = opensim.AnalyzeTool()
    tool.setName("analysed")
    tool.setModelFilename(str(folder / "motion.osim"))
    tool.setCoordinatesFileName(str(folder / "motion.mot"))
    times = table(folder / "motion.mot")["times"]
    tool.setInitialTime(times[0])
    tool.setFinalTime(times[-1])
    tool.setResultsDir(str(folder))
    kinematics = opensim.Kinematics()
    kinematics.setInDegrees(True)
    tool.updAnalysisSet().cloneAndAppend(kinematics)
    setup = str(folder / "analyse.xml")
    tool.printToXML(setup)
    opensim.AnalyzeTool(setup).run()
    return table(folder / "analysed_Kinematics_q.sto")


def inverse(folder):
    """Joint angles [deg] by OpenSim's inverse kinematics of the markers."""
    tool = opensim.InverseKinematicsTool()
    tool.set_model_file(str(folder / "motion.osim"))
    tool.set_marker_file(str(folder / "motion.trc"))
    tool.set_output_motion_file(str(folder / "inverse.mot"))
    tool.set_results_directory(str(folder))
    tool.set_accuracy(1e-9)
    tool.run()
    return table(folder / "inverse.mot")


def main(folder, output):
    folder = folder.resolve()
    said = {"moved": moved(folder), "analysed": analysed(folder), "inverse": inverse(folder)}
    output.write_text(json.dumps(said))


main(*map(Path, sys.argv[1:]))
