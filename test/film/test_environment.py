"""Rides in places that were not there: what touches what."""

import numpy as np
import pytest
from helpers.known_walk import walking_body

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment_yaml import equipment_path, read_equipment
from bodycam_ros.errors import ViewError
from bodycam_ros.film.character import Character
from bodycam_ros.film.environment import Environment
from bodycam_ros.film.machines import WHEEL_M, machine_parts
from bodycam_ros.film.views import looking_at
from bodycam_ros.geometry import transform_points
from bodycam_ros.results.solved_body import SolvedBody

TOUCHES_M = 5e-3
