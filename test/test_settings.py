"""Settings from mappings, parameter files and flags."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from helpers.naming import naming

from bodycam_ros.cli.command_parser import CommandParser
from bodycam_ros.cli.options import read_settings
from bodycam_ros.errors import SettingsError
from bodycam_ros.settings import RENAMED, SettingsGroups, describe, read_settings_file, setting, settings_from_mapping


@dataclass(frozen=True)
class OvenSettings:
    """Settings of three types, and one without limits."""

    heat: float = setting(180.0, unit="degC", limits=(50.0, 250.0), reason="bakes 95 % through without burning")
    trays: int | str = setting(2, limits=(1, 4), words=("all",), reason="what fits")
    fan: bool = setting(True, reason="evens out the heat")
    recipe: str = setting("bread", reason="what most people want")


@dataclass(frozen=True)
class FridgeSettings:
    cold: float = setting(4.0, unit="degC", limits=(0.0, 10.0), reason="keeps milk for a week")


@dataclass(frozen=True)
class KitchenSettings(SettingsGroups):
    oven: OvenSettings = OvenSettings()
    fridge: FridgeSettings = FridgeSettings()


@dataclass(frozen=True)
class ForgottenDefault:
    heat: float


def test_description_says_reason_unit_and_range() -> None:
    heat, trays, fan, recipe = describe(OvenSettings)
    assert heat.text() == "bakes 95 % through without burning [degC] (50 to 250)"
    assert trays.text() == "what fits (1 to 4, or 'all')"
    assert fan.text() == "evens out the heat"
    assert (recipe.type, recipe.default) == (str, "bread")


def test_field_without_default_is_a_defect() -> None:
    with naming(TypeError, "ForgottenDefault.heat"):
        list(describe(ForgottenDefault))


def test_what_is_absent_keeps_its_default() -> None:
    assert settings_from_mapping(OvenSettings, {}, "here") == OvenSettings()
    assert settings_from_mapping(OvenSettings, {"trays": 4, "heat": 60}, "here") == OvenSettings(heat=60.0, trays=4)


def test_a_word_may_stand_for_a_number(config: Path) -> None:
    assert settings_from_mapping(OvenSettings, {"trays": "all"}, "here").trays == "all"
    assert settings_of("--oven.trays", "all", config=config).trays == "all"
    assert settings_of("--oven.trays", "3", config=config).trays == 3


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"warmth": 1.0}, "here: there is no setting 'warmth'; there are fan, heat, recipe, trays"),
        ({"heat": "hot"}, "heat = 'hot': Expected float, got str; bakes 95 %"),
        ({"heat": True}, "heat = True: Expected float, got bool"),
        ({"trays": 2.0}, "trays = 2.0: Expected int | str, got float"),
        ({"trays": "none"}, "trays = 'none': Invalid enum value"),
        ({"fan": 1}, "fan = 1: Expected bool, got int"),
        ({"recipe": None}, "recipe = None: Expected str, got null"),
        ({"heat": 49.9}, "heat = 49.9: Expected float >= 50.0; bakes 95 % through without burning [degC] (50 to 250)"),
        ({"heat": float("nan")}, "heat = nan: Expected float >= 50.0"),
        ({"trays": 5}, "trays = 5: Expected int <= 4"),
    ],
)
def test_wrong_values_are_refused(values: dict[str, Any], complaint: str) -> None:
    with pytest.raises(SettingsError) as caught:
        settings_from_mapping(OvenSettings, values, "here")
    assert complaint in str(caught.value)


def test_groups_are_the_fields_of_the_class() -> None:
    assert KitchenSettings.groups() == {"oven": OvenSettings, "fridge": FridgeSettings}
    assert KitchenSettings(fridge=FridgeSettings(2.0)).as_mapping()["fridge"] == {"cold": 2.0}


def test_limits_are_inclusive() -> None:
    assert settings_from_mapping(OvenSettings, {"heat": 250.0, "trays": 1}, "here").heat == 250.0


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "oven.yaml"
    path.write_text("/**:\n  ros__parameters:\n    use_sim_time: true\n    oven: {heat: 100.0, trays: 1}\n")
    return path


def test_parameter_file_is_read_by_group(config: Path) -> None:
    assert read_settings_file(config) == {"oven": {"heat": 100.0, "trays": 1}}


@pytest.mark.parametrize("text", ["", "[1, 2]", "oven: {heat: 100.0}", "/**: {ros__parameters: 3}", "a: [", "\x00"])
def test_other_files_are_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.yaml"
    path.write_text(text)
    with naming(SettingsError, path):
        read_settings_file(path)
    with naming(SettingsError, tmp_path / "missing.yaml"):
        read_settings_file(tmp_path / "missing.yaml")


def settings_of(*flags: str, config: Path | None = None) -> OvenSettings:
    parser = CommandParser()
    parser.read_groups = lambda: {*KitchenSettings.groups()}
    arguments = parser.parse_args(flags)
    arguments.config = config
    kitchen = read_settings(arguments, KitchenSettings)
    assert kitchen.fridge == FridgeSettings()
    return kitchen.oven


def test_flags_win_over_the_file_which_wins_over_defaults(config: Path) -> None:
    assert settings_of() == OvenSettings()
    assert settings_of(config=config) == OvenSettings(heat=100.0, trays=1)
    assert settings_of("--oven.heat", "120", "--oven.fan", "false", config=config) == OvenSettings(120.0, 1, False)


def test_bad_value_says_where_it_stands(config: Path) -> None:
    with naming(SettingsError, "--oven", "heat", "20", "50.0"):
        settings_of("--oven.heat", "20", config=config)
    config.write_text(config.read_text().replace("100.0", "20.0"))
    with naming(SettingsError, config, "heat", "20.0", "50.0"):
        settings_of("--oven.heat", "120", config=config)


def test_a_file_may_hold_groups_of_other_commands_but_none_that_is_misspelt(config: Path) -> None:
    others = config.read_text() + "    registrar: {min_inliers: 20}\n    features: {}\n"
    config.write_text(others)
    assert settings_of(config=config).heat == 100.0
    config.write_text(others.replace("registrar", "registrer"))
    with naming(SettingsError, config, "registrer", "registrar"):
        settings_of(config=config)


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (("--oven.heat", "hot"), "--oven: heat = 'hot': Expected float"),
        (("--oven.fan=perhaps",), "--oven: fan = 'perhaps': Expected bool"),
        (("--oven.trays", "none"), "--oven: trays = 'none'"),
        (("--oven.warmth", "3"), "--oven: there is no setting 'warmth'"),
    ],
)
def test_wrong_flags_are_named(flags: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(SettingsError) as caught:
        settings_of(*flags)
    assert complaint in str(caught.value)


@pytest.mark.parametrize("flags", [("--stove.heat", "3"), ("--oven.heat",)])
def test_flags_of_other_commands_and_without_value_are_a_usage_error(
    flags: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        settings_of(*flags)
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert flags[0] in said and "[options]" in said.splitlines()[0]


@pytest.mark.parametrize("key", ["1", "null", "2001-02-03", "true", "1.5"])
def test_keys_that_are_no_names_are_refused(tmp_path: Path, key: str) -> None:
    file = tmp_path / "settings.yaml"
    file.write_text(f"/**: {{ros__parameters: {{{key}: 2}}}}")
    with naming(SettingsError, file):
        read_settings_file(file)
    file.write_text(f"/**: {{ros__parameters: {{oven: {{{key}: 2}}}}}}")
    with naming(SettingsError, "settings.yaml: oven"):
        settings_from_mapping(OvenSettings, read_settings_file(file)["oven"], "settings.yaml: oven")


@pytest.mark.parametrize("old", RENAMED)
def test_a_name_that_has_changed_is_refused_with_the_new_one(tmp_path: Path, old: str) -> None:
    file = tmp_path / "settings.yaml"
    for text in (f"{{{old}: {{heat: 100.0}}}}", f"{{{old}.heat: 100.0}}"):
        file.write_text(f"/**: {{ros__parameters: {text}}}")
        with naming(SettingsError, file, old, RENAMED[old]):
            read_settings_file(file)
    with naming(SettingsError, f"--{old}.heat", RENAMED[old]):
        settings_of(f"--{old}.heat", "100")
