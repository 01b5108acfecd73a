"""Creates what every object of an IFC model needs: placement, body, properties, quantities.

The model's axes are those of the drawing: x to the right on the paper, y up on it, z up; metres.
"""

import json
import math
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, TypeAlias

import ifcopenshell
import ifcopenshell.api.aggregate
import ifcopenshell.api.context
import ifcopenshell.api.geometry
import ifcopenshell.api.pset
import ifcopenshell.api.root
import ifcopenshell.api.spatial
import ifcopenshell.api.unit
import numpy as np
from ifcopenshell import guid
from ifcopenshell.util.shape_builder import ShapeBuilder

from companion.core.messages import FloorPlan

Entity: TypeAlias = ifcopenshell.entity_instance
View: TypeAlias = Literal["MODEL_VIEW", "GRAPH_VIEW"]
UNITS = ("LENGTHUNIT", "AREAUNIT", "VOLUMEUNIT", "PLANEANGLEUNIT")
"""Kinds of units: metre, square metre, cubic metre, radian."""
VIEW_DEFINITION = "ViewDefinition [DesignTransferView_V1.0]"
"""Part of the standard that programs must know to read the model: bodies with openings."""
OWN_SET = "PDPS_Measurement"
"""Name of the property sets that say how a value was measured. `Pset_` is reserved by the
standard."""
NAMESPACE = uuid.UUID("5f6b1c1e-3c0e-4b7e-9a53-0d0f4d2f6a11")
"""Namespace of the objects' GlobalIds. Chosen at random."""


class Model:
    """A model that grows object by object."""

    def __init__(self, title: str) -> None:
        self.file = ifcopenshell.file(schema="IFC4")
        self.project = self.create("IfcProject", title)
        units = [ifcopenshell.api.unit.add_si_unit(self.file, unit_type=unit) for unit in UNITS]
        ifcopenshell.api.unit.assign_unit(self.file, units=units)
        self.context = ifcopenshell.api.context.add_context(self.file, context_type="Model")
        self._body = self._view("Body", "MODEL_VIEW")
        self._axis = self._view("Axis", "GRAPH_VIEW")
        self._builder = ShapeBuilder(self.file)

    def _view(self, name: Literal["Body", "Axis"], kind: View) -> Entity:
        return ifcopenshell.api.context.add_context(
            self.file,
            context_type="Model",
            context_identifier=name,
            target_view=kind,
            parent=self.context,
        )

    def create(self, kind: str, name: str, predefined_type: str | None = None) -> Entity:
        """Create an object of a class of IFC."""
        return ifcopenshell.api.root.create_entity(self.file, kind, predefined_type, name)

    def part(
        self, kind: str, name: str, whole: Entity, predefined_type: str | None = None
    ) -> Entity:
        """Create an object that is a part of another, at its origin."""
        entity = self.create(kind, name, predefined_type)
        ifcopenshell.api.aggregate.assign_object(
            self.file, products=[entity], relating_object=whole
        )
        self.place(entity)
        return entity

    def place(self, entity: Entity, origin: complex = 0j, along: complex = 1 + 0j) -> None:
        """Put an object at a place x + y·j, m, with its x axis along a direction of length 1."""
        matrix = np.eye(4)
        matrix[:2, 0] = along.real, along.imag
        matrix[:2, 1] = -along.imag, along.real
        matrix[:2, 3] = origin.real, origin.imag
        ifcopenshell.api.geometry.edit_object_placement(self.file, product=entity, matrix=matrix)

    def contain(self, entity: Entity, storey: Entity) -> None:
        """Put an object into a storey."""
        ifcopenshell.api.spatial.assign_container(
            self.file, products=[entity], relating_structure=storey
        )

    def point_north(self, up_heading_rad: float) -> None:
        """Note the direction of true north. `up_heading_rad`: true heading of the y axis."""
        north = -math.sin(up_heading_rad), math.cos(up_heading_rad)
        self.context.TrueNorth = self.file.create_entity("IfcDirection", north)

    def give_body(
        self, entity: Entity, rings: Sequence[Sequence[complex]], height_m: float
    ) -> None:
        """Give an object an upright body over an outline, and holes in it, in its own axes, m."""
        outline, *holes = (self._line(ring, is_closed=True) for ring in rings)
        profile = self._builder.profile(outline, inner_curves=holes)
        body = self._builder.extrude(profile, magnitude=height_m)
        self._represent(entity, self._body, body)

    def give_axis(self, entity: Entity, length_m: float) -> None:
        """Give a wall its axis, from its origin along x."""
        self._represent(entity, self._axis, self._line((0j, complex(length_m))))

    def _line(self, points: Sequence[complex], *, is_closed: bool = False) -> Entity:
        places = [(point.real, point.imag) for point in points]
        return self._builder.polyline(places, closed=is_closed)

    def _represent(self, entity: Entity, context: Entity, item: Entity) -> None:
        shape = self._builder.get_representation(context, [item])
        ifcopenshell.api.geometry.assign_representation(
            self.file, product=entity, representation=shape
        )

    def say(self, entity: Entity, **properties: Any) -> None:
        """Give an object properties of our own: lengths, truths and texts."""
        said = ifcopenshell.api.pset.add_pset(self.file, product=entity, name=OWN_SET)
        values = {
            name: self.file.create_entity("IfcText", each) if isinstance(each, str) else each
            for name, each in properties.items()
        }
        ifcopenshell.api.pset.edit_pset(self.file, pset=said, properties=values)

    def length(self, length_m: float) -> Entity:
        """A length as the value of a property."""
        return self.file.create_entity("IfcLengthMeasure", length_m)

    def measure(self, entity: Entity, name: str, quantities: Mapping[str, float]) -> None:
        """Give an object a set of quantities of the standard, m and m²."""
        measured = ifcopenshell.api.pset.add_qto(self.file, product=entity, name=name)
        ifcopenshell.api.pset.edit_qto(self.file, qto=measured, properties=dict(quantities))

    def write(self, path: Path, plan: FloorPlan) -> None:
        """Write the file. The same map gets the same GlobalIds, so that programs know it again."""
        walls = json.dumps([asdict(wall) for wall in plan.walls])
        for number, entity in enumerate(self.file.by_type("IfcRoot")):
            entity.GlobalId = guid.compress(uuid.uuid5(NAMESPACE, f"{number} {walls}").hex)
        header = self.file.header
        header.file_description.description = (VIEW_DEFINITION,)
        header.file_name.name = path.name
        header.file_name.originating_system = f"pdps-companion {version('pdps-companion')}"
        self.file.write(str(path))
