"""VTK's own readers: XML files in every version, the companions where it reads VTKHDF over time."""

import xml.etree.ElementTree as XML

import numpy
import pytest
import vtk
from conftest import padded
from vtk.util.numpy_support import vtk_to_numpy

VERSION = (vtk.vtkVersion.GetVTKMajorVersion(), vtk.vtkVersion.GetVTKMinorVersion())


class Mesh:
    """A frame as arrays."""

    def __init__(self, poly):
        self.points = vtk_to_numpy(poly.GetPoints().GetData())
        self.verts = poly.GetNumberOfVerts()
        lines = vtk_to_numpy(poly.GetLines().GetConnectivityArray()) if poly.GetNumberOfLines() else numpy.zeros(0, int)
        self.lines = lines.reshape(-1, 2)
        self.time = None
        if poly.GetFieldData().GetArray("TimeValue"):
            self.time = poly.GetFieldData().GetArray("TimeValue").GetValue(0)
        self.of_points, self.of_cells = (
            {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}
            for data in (poly.GetPointData(), poly.GetCellData())
        )


def xml(folder, kind):
    """A function that reads a frame of the list KIND.pvd."""
    sets = XML.parse(folder / f"{kind}.pvd").getroot().findall("Collection/DataSet")

    def frame(k):
        reader = vtk.vtkXMLPolyDataReader()
        reader.SetFileName(str(folder / sets[k].get("file")))
        reader.Update()
        assert reader.GetErrorCode() == 0
        mesh = Mesh(reader.GetOutput())
        assert mesh.time == float(sets[k].get("timestep"))
        return mesh

    frame.times = [float(one.get("timestep")) for one in sets]
    return frame


def hdf(folder, kind):
    """The same of KIND.vtkhdf."""
    if VERSION < (9, 4):
        pytest.skip("VTK before 9.4 reads no poly data over time from VTKHDF")
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(folder / f"{kind}.vtkhdf"))
    reader.UpdateInformation()

    def frame(k):
        reader.SetStep(k)
        reader.Update()
        assert reader.GetErrorCode() == 0
        return Mesh(reader.GetOutput())

    frame.times = list(reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()))
    return frame


@pytest.fixture(params=["vtp", "vtkhdf"])
def read(request, case):
    """A function that opens the grains, contacts or bonds of the case."""
    reader = {"vtp": xml, "vtkhdf": hdf}[request.param]
    return lambda kind: reader(case.folders[request.param], kind)


def test_grains(case, read):
    frame = read("grains")
    assert frame.times == list(case.times)
    for k in case.some():
        mesh = frame(k)
        assert mesh.verts == len(mesh.points) == case.radius.size
        assert (mesh.points == case.positions(k)).all()
        assert (mesh.of_points["velocity"] == case.velocities(k)).all()
        for name in ("radius", "mass", "id"):
            assert (mesh.of_points[name] == case.grains[name][:]).all()
        spin = case.grains["angular_velocity/value"][k]
        if spin.ndim == 1:
            assert (mesh.of_points["angular_velocity"][:, 2] == spin).all()
            assert (mesh.of_points["angle"] == case.grains["angle/value"][k]).all()
        else:
            assert (mesh.of_points["angular_velocity"] == spin).all()
            assert (mesh.of_points["orientation"] == case.grains["orientation/value"][k]).all()


def test_bonds(case, read):
    if "bonds" not in case.history:
        assert not [file for folder in case.folders.values() for file in folder.glob("bonds*")]
        return
    frame, bonds, states = read("bonds"), case["bonds"], set()
    assert frame.times == list(case.times)
    for k in case.some():
        mesh = frame(k)
        assert (mesh.points == case.positions(k)).all()
        assert (mesh.lines == bonds["pair"][:]).all()
        assert (mesh.of_cells["status"] == bonds["status/value"][k]).all()
        for name in ("strength", "friction", "rest_gap", "mean_diameter"):
            assert (mesh.of_cells[name] == bonds[name][:]).all()
        states.update(mesh.of_cells["status"])
    assert case.name != "flat" or len(states) > 1


def test_contacts(case, read):
    frame, contacts, seen = read("contacts"), case["contacts"], 0
    for k in case.some():
        mesh, rows = frame(k), case.contacts(k)
        pair, point, centres = contacts["pair"][rows], padded(contacts["point"][rows]), case.positions(k)
        assert len(mesh.lines) == len(pair)
        if len(pair) == 0:
            continue
        ends, at_wall = mesh.points[mesh.lines], pair[:, 1] < 0
        assert (ends[:, 0] == centres[pair[:, 0]]).all()
        assert (ends[:, 1] == numpy.where(at_wall[:, None], point, centres[pair[:, 1]])).all()
        reaction = contacts["reaction"][rows]
        cells = mesh.of_cells
        assert (cells["normal_force"] == reaction[:, 0]).all()
        assert (cells["tangential_force"].reshape(len(pair), -1) == reaction[:, 1:]).all()
        for name in ("gap", "status", "moment", "bond"):
            assert (name in cells) == (name in contacts)
            assert name not in contacts or (cells[name] == contacts[name][rows]).all()
        for name in ("point", "normal", "tangent"):
            assert (name in cells) == (name in contacts)
            assert name not in contacts or (cells[name] == padded(contacts[name][rows])).all()
        seen += at_wall.sum() + (at_wall.any() and not at_wall.all())
    assert seen > 1
