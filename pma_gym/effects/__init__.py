"""The catalogue of effects: every physical phenomenon that a plant can have, one file each."""

from pma_gym.effects.cable.cable import CABLE
from pma_gym.effects.cable.hanging_load import HANGING_LOAD
from pma_gym.effects.cable.leg import LEG
from pma_gym.effects.contact.backlash import BACKLASH
from pma_gym.effects.contact.cogging import COGGING, JOINT_COGGING
from pma_gym.effects.contact.constant_force import CONSTANT_FORCE, CONSTANT_TORQUE
from pma_gym.effects.contact.contact_friction import CONTACT_FRICTION, PRESSURE_FRICTION
from pma_gym.effects.contact.directional_damping import (
    DIRECTIONAL_DAMPING,
    JOINT_DIRECTIONAL_DAMPING,
)
from pma_gym.effects.contact.imposed_motion import IMPOSED_MOTION
from pma_gym.effects.contact.load_dependent_friction import (
    JOINT_LOAD_FRICTION,
    LOAD_DEPENDENT_FRICTION,
)
from pma_gym.effects.contact.piston_force import PISTON_FORCE
from pma_gym.effects.contact.position_friction import (
    JOINT_POSITION_FRICTION,
    POSITION_FRICTION,
)
from pma_gym.effects.contact.quadratic_drag import JOINT_DRAG, QUADRATIC_DRAG
from pma_gym.effects.contact.second_mass import SECOND_MASS
from pma_gym.effects.contact.spring import (
    HARDENING_SPRING,
    JOINT_HARDENING_SPRING,
    JOINT_SPRING,
    SPRING,
)
from pma_gym.effects.delay import DRIVE_DELAY, REGULATOR_DELAY
from pma_gym.effects.drive.bearing_friction import BEARING_FRICTION
from pma_gym.effects.drive.current_imbalance import CURRENT_IMBALANCE
from pma_gym.effects.drive.directional_gain import DIRECTIONAL_GAIN
from pma_gym.effects.drive.drive import DRIVE
from pma_gym.effects.drive.drive_dead_zone import DRIVE_DEAD_BAND, DRIVE_DEAD_ZONE
from pma_gym.effects.drive.drive_lag import DRIVE_LAG
from pma_gym.effects.drive.drive_saturation import DRIVE_SATURATION
from pma_gym.effects.drive.position_map import POSITION_MAP
from pma_gym.effects.drive.rotor import ROTOR
from pma_gym.effects.drive.servo import SERVO, SERVO_INERTIA
from pma_gym.effects.drive.torque_ripple import TORQUE_RIPPLE
from pma_gym.effects.drive.two_way_drive import TWO_WAY_DRIVE
from pma_gym.effects.effect import Effect, antagonist
from pma_gym.effects.joint.inertia import INERTIA, JOINT_START
from pma_gym.effects.joint.moment_arm import LEVER, PULLEY
from pma_gym.effects.joint.motor import DC_MOTOR, TORQUE_DRIVE
from pma_gym.effects.joint.passive_torque import JOINT_DAMPING, JOINT_FRICTION, JOINT_WEIGHT
from pma_gym.effects.limits import JOINT_RANGE, LIMITS, VALIDITY
from pma_gym.effects.muscle.colbrunn import COLBRUNN_SPRING
from pma_gym.effects.muscle.contractile_force import CONTRACTILE_FORCE
from pma_gym.effects.muscle.creep import CREEP, SLOW_CREEP
from pma_gym.effects.muscle.damping import DAMPING, SYMMETRIC_DAMPING
from pma_gym.effects.muscle.geometric_force import (
    CALDWELL_FORCE,
    CHOU_HANNAFORD_FORCE,
    SCHULTE_FORCE,
    SCHULZ_FORCE,
    TONDU_LOPEZ_FORCE,
)
from pma_gym.effects.muscle.hysteresis import HYSTERESIS
from pma_gym.effects.muscle.load_dependent_damping import LOAD_DEPENDENT_DAMPING
from pma_gym.effects.muscle.nonlinear_stiffness import NONLINEAR_STIFFNESS
from pma_gym.effects.muscle.passive_stretch import PASSIVE_STRETCH
from pma_gym.effects.muscle.prandtl_ishlinskii import STOP_OPERATORS
from pma_gym.effects.muscle.pressure_curvature import PRESSURE_CURVATURE
from pma_gym.effects.muscle.repperger import REPPERGER_DAMPING, REPPERGER_SPRING
from pma_gym.effects.muscle.sarosi import SAROSI_FORCE
from pma_gym.effects.muscle.stiffness import STIFFNESS
from pma_gym.effects.muscle.warm_up import WARM_UP
from pma_gym.effects.regulator.air_chamber import AIR_CHAMBER, LEAK, SUPPLY
from pma_gym.effects.regulator.co_contraction import CO_CONTRACTION
from pma_gym.effects.regulator.filling import FILLING
from pma_gym.effects.regulator.regulator import REGULATOR_LAG, REGULATOR_LINE
from pma_gym.effects.regulator.regulator_asymmetry import REGULATOR_ASYMMETRY
from pma_gym.effects.regulator.regulator_deadband import REGULATOR_DEADBAND
from pma_gym.effects.regulator.regulator_rate_limit import REGULATOR_RATE_LIMIT
from pma_gym.effects.regulator.regulator_second_order import REGULATOR_SECOND_ORDER
from pma_gym.effects.regulator.valve import AIR_VALVES
from pma_gym.effects.residual_law import (
    RESIDUAL_DAMPING_OF_ANGLE,
    RESIDUAL_DAMPING_OF_POSITION,
    RESIDUAL_FORCE_OF_CONTRACTION,
    RESIDUAL_FORCE_OF_POSITION,
    RESIDUAL_FORCE_OF_PRESSURE,
    RESIDUAL_FORCE_OF_VELOCITY,
    RESIDUAL_LOAD,
    RESIDUAL_TORQUE_OF_ANGLE,
    RESIDUAL_TORQUE_OF_SPEED,
)
from pma_gym.effects.rig_ports import SECOND_PORTS
from pma_gym.effects.sensors.bent_sensor import BENT_SENSORS
from pma_gym.effects.sensors.potentiometer_backlash import POTENTIOMETER_BACKLASH
from pma_gym.effects.sensors.sensor_backlash import SENSOR_BACKLASHES
from pma_gym.effects.sensors.sensor_delay import SENSOR_DELAYS
from pma_gym.effects.sensors.sensor_errors import (
    FORCE_SENSOR_ERROR,
    LOAD_CELL_ERROR,
    LVDT_ERROR,
    POTENTIOMETER_ERROR,
    PRESSURE_TRANSDUCER_ERROR,
)
from pma_gym.effects.sensors.sensors import FORCE_SENSOR, JOINT_SENSORS, SENSORS, TACHOMETER
from pma_gym.effects.slide.coulomb_friction import COULOMB_FRICTION
from pma_gym.effects.slide.hand_push import HAND_PUSH
from pma_gym.effects.slide.slide import SLIDE
from pma_gym.effects.slide.start import START

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        CONTRACTILE_FORCE,
        STIFFNESS,
        SAROSI_FORCE,
        SCHULTE_FORCE,
        SCHULZ_FORCE,
        CHOU_HANNAFORD_FORCE,
        CALDWELL_FORCE,
        TONDU_LOPEZ_FORCE,
        COLBRUNN_SPRING,
        REPPERGER_SPRING,
        PRESSURE_CURVATURE,
        NONLINEAR_STIFFNESS,
        WARM_UP,
        PASSIVE_STRETCH,
        DAMPING,
        SYMMETRIC_DAMPING,
        REPPERGER_DAMPING,
        LOAD_DEPENDENT_DAMPING,
        CREEP,
        SLOW_CREEP,
        HYSTERESIS,
        COULOMB_FRICTION,
        HAND_PUSH,
        RESIDUAL_FORCE_OF_CONTRACTION,
        RESIDUAL_FORCE_OF_POSITION,
        RESIDUAL_FORCE_OF_VELOCITY,
        RESIDUAL_FORCE_OF_PRESSURE,
        RESIDUAL_DAMPING_OF_POSITION,
        RESIDUAL_DAMPING_OF_ANGLE,
        RESIDUAL_TORQUE_OF_ANGLE,
        RESIDUAL_TORQUE_OF_SPEED,
        CABLE,
        DRIVE,
        TWO_WAY_DRIVE,
        DRIVE_DEAD_ZONE,
        DRIVE_SATURATION,
        DRIVE_DELAY,
        RESIDUAL_LOAD,
        DRIVE_LAG,
        TORQUE_RIPPLE,
        CURRENT_IMBALANCE,
        BEARING_FRICTION,
        ROTOR,
        HANGING_LOAD,
        LEG,
        SLIDE,
        START,
        TACHOMETER,
        REGULATOR_LINE,
        REGULATOR_DELAY,
        REGULATOR_LAG,
        REGULATOR_ASYMMETRY,
        REGULATOR_RATE_LIMIT,
        REGULATOR_DEADBAND,
        FILLING,
        POSITION_MAP,
        SERVO,
        SERVO_INERTIA,
        *SENSORS,
        LVDT_ERROR,
        LOAD_CELL_ERROR,
        PRESSURE_TRANSDUCER_ERROR,
        POTENTIOMETER_ERROR,
        POTENTIOMETER_BACKLASH,
        LIMITS,
        VALIDITY,
        TORQUE_DRIVE,
        DC_MOTOR,
        JOINT_WEIGHT,
        JOINT_SPRING,
        JOINT_DAMPING,
        JOINT_FRICTION,
        QUADRATIC_DRAG,
        JOINT_DRAG,
        DIRECTIONAL_DAMPING,
        JOINT_DIRECTIONAL_DAMPING,
        SPRING,
        HARDENING_SPRING,
        JOINT_HARDENING_SPRING,
        LOAD_DEPENDENT_FRICTION,
        JOINT_LOAD_FRICTION,
        POSITION_FRICTION,
        JOINT_POSITION_FRICTION,
        DRIVE_DEAD_BAND,
        DIRECTIONAL_GAIN,
        CONSTANT_TORQUE,
        INERTIA,
        JOINT_START,
        *JOINT_SENSORS,
        IMPOSED_MOTION,
        PISTON_FORCE,
        CONSTANT_FORCE,
        CONTACT_FRICTION,
        PRESSURE_FRICTION,
        COGGING,
        JOINT_COGGING,
        BACKLASH,
        SECOND_MASS,
        FORCE_SENSOR,
        FORCE_SENSOR_ERROR,
        *SENSOR_DELAYS,
        *BENT_SENSORS,
        *SENSOR_BACKLASHES,
        *STOP_OPERATORS,
        PULLEY,
        LEVER,
        JOINT_RANGE,
        CO_CONTRACTION,
        REGULATOR_SECOND_ORDER,
        AIR_CHAMBER,
        LEAK,
        *AIR_VALVES,
        SUPPLY,
    )
}
"""Effects by name, in the order in which plants sum them."""

CATALOGUE |= {
    second.name: second
    for effect in CATALOGUE.values()
    if effect.port in SECOND_PORTS
    for second in (antagonist(effect),)
}

__all__ = ["CATALOGUE", "Effect"]
