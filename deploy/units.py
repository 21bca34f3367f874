"""Files for systemd: the CAN interfaces, the services of ECU, recorder and gateway, their user. Text from settings; nothing is written here.

systemd.network(5), systemd.service(5), systemd.exec(5), sysusers.d(5).
"""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace

from deploy.settings import CORES, GatewaySettings, RecorderSettings, ServiceSettings
from deploy.words import executable, word
from ecu.offered.services import ServiceOptions
from hil.ending import Ending
from hil.shell.realtime_options import RealtimeOptions

ECU, RECORDER, GATEWAY = "loaderhil-ecu", "loaderhil-recorder", "loaderhil-gateway"
USER = "loaderhil"
SETTINGS = "/etc/loaderhil/ecu.toml"
START_TIMEOUT_S = 180
"""A first start compiles the estimators: 20 to 40 s on a desktop processor, some times that on a small one."""


def service_files(
    settings: ServiceSettings,
    program: str,
    settings_file: str = SETTINGS,
    ecu_program: str | None = None,
) -> Mapping[str, str]:
    """Path below the root of the target -> text.

    program: absolute path of the `loaderhil` command on the target; settings_file: absolute path there; ecu_program: that of the
    exported program for Linux, which is the ECU then and needs no Python.
    Raises UserError for a program or a file that the services would not find.
    """
    interfaces = [settings.can.interface]
    services = {
        ECU: _ecu(settings, program, settings_file)
        if ecu_program is None
        else _exported(settings, ecu_program)
    }
    if settings.recorder is not None:
        services[RECORDER] = _recorder(settings, settings.recorder, program)
    if settings.gateway is not None:
        interfaces.append(settings.gateway.machine_interface)
        services[GATEWAY] = _gateway(settings, settings.gateway, program)
    return {
        **{
            f"etc/systemd/network/70-loaderhil-{name}.network": _network(settings, name)
            for name in interfaces
        },
        **{f"etc/systemd/system/{name}.service": text for name, text in services.items()},
        "usr/lib/sysusers.d/loaderhil.conf": f'u {USER} - "loaderhil virtual ECU"\n',
    }


def _network(settings: ServiceSettings, interface: str) -> str:
    can = settings.can
    return f"""\
# systemd-networkd sets the bit rate and brings {interface} up whenever it appears, also after an unplug.
[Match]
Name={interface}

[CAN]
BitRate={can.bit_rate}
RestartSec={can.restart_ms}ms
"""


def _devices(interfaces: Sequence[str]) -> str:
    """The names under which systemd knows the interfaces."""
    return " ".join(f"sys-subsystem-net-devices-{name}.device" for name in interfaces)


def _unit(description: str, interfaces: Sequence[str]) -> str:
    """The section [Unit] of a service that lives as long as its interfaces."""
    devices = _devices(interfaces)
    return f"""\
[Unit]
Description={description}
# An interface is a device of the unit: an unplug stops the service, and the next plug starts it again.
BindsTo={devices}
After={devices} systemd-networkd.service
# No attempt is the last one: the cause may pass by itself, such as a second ECU on the bus. Until then nothing is sent, and the machine is
# on its own safe limits.
StartLimitIntervalSec=0
"""


def _install(interfaces: Sequence[str]) -> str:
    return f"""\

[Install]
WantedBy=multi-user.target {_devices(interfaces)}
"""


def _rights(realtime: RealtimeOptions) -> str:
    """Capabilities and limits: each only where an option needs it, so that what a service may do follows from its settings."""
    needed = [
        *(["CAP_SYS_NICE"] if realtime.fifo is not None else []),
        *(["CAP_IPC_LOCK"] if realtime.lock_memory else []),
    ]
    capabilities = " ".join(needed)
    return f"""\
AmbientCapabilities={capabilities}
CapabilityBoundingSet={capabilities}
LimitMEMLOCK={"infinity" if realtime.lock_memory else "64K"}
LimitRTPRIO={realtime.fifo or 0}
"""


SANDBOX = """\
NoNewPrivileges=yes
ProtectSystem=strict
ProtectHome=yes
PrivateTmp=yes
ProtectClock=yes
ProtectControlGroups=yes
ProtectHostname=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
ProtectProc=invisible
RestrictNamespaces=yes
RestrictSUIDSGID=yes
LockPersonality=yes
RemoveIPC=yes
UMask=0077
DevicePolicy=closed
IPAddressDeny=any
# AF_CAN: frames. AF_NETLINK: the kernel reports there whether the CAN interface is up. AF_UNIX: readiness and watchdog go to systemd.
# AF_INET: no packet is sent; the ioctl that returns the length of the interface's transmit queue needs some socket of this family.
RestrictAddressFamilies=AF_CAN AF_NETLINK AF_UNIX AF_INET
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallErrorNumber=EPERM
"""
CODE = """\
# Compiled code is kept from one start to the next.
CacheDirectory=loaderhil
Environment=NUMBA_CACHE_DIR=/var/cache/loaderhil HOME=/var/cache/loaderhil
"""


def _offered_words(offered: ServiceOptions) -> list[str]:
    """Options of `loaderhil ecu`, quoted as systemd reads them."""
    named = {
        "--xcp": offered.xcp,
        "--uds": offered.uds,
        "--j1939": offered.j1939,
        "--access-key": None if offered.access_key is None else str(offered.access_key),
    }
    return [f"{option} {word(value)}" for option, value in named.items() if value is not None]


def _judging_words(settings: ServiceSettings) -> list[str]:
    """Options of both programs: whether the ECU limits, and whether it tests its sensors, said either way."""
    detects = "--detect-faults" if settings.detect_faults else "--no-detect-faults"
    return [*([] if settings.limits else ["--no-limits"]), detects]


def _ecu(settings: ServiceSettings, program: str, settings_file: str) -> str:
    interface, realtime = settings.can.interface, settings.realtime
    options = [
        f"--bus {settings.address}",
        f"--calibration {word(settings.calibration)}",
        f"--form {settings.form}",
        *_judging_words(settings),
        *([] if settings.core == CORES[0] else [f"--core {settings.core}"]),
        *_offered_words(settings.offered),
        *realtime.words(),
    ]
    return f"""\
{_unit(f"loaderhil virtual ECU on {interface}", [interface])}
[Service]
Type=notify
User={USER}
ExecStartPre={executable(program)} deploy check {word(settings_file)}
ExecStart={executable(program)} ecu {" ".join(options)}
TimeoutStartSec={START_TIMEOUT_S}
WatchdogSec={settings.watchdog_s:g}
# Without the ECU the machine falls back on safe limits by itself, so that a quick restart costs comfort and not safety.
Restart=always
RestartSec=0.2
# A wrong option does not mend itself.
RestartPreventExitStatus={int(Ending.MISUSED)}
SuccessExitStatus={int(Ending.INTERRUPTED)}

{CODE}
{_rights(realtime)}
# Sandbox. MemoryDenyWriteExecute stays off: the estimators are compiled when first used.
{SANDBOX}{_install([interface])}"""


def _exported(settings: ServiceSettings, program: str) -> str:
    """The unit of the exported program. Raises ConfigurationError for what it does not have."""
    for key, lacks in (
        ("ecu.core", settings.core != "c"),
        ("ecu.form", settings.form != "corrected"),
    ):
        if lacks:
            raise settings.error(
                key,
                "does not fit --ecu-program: the exported program is core c, with the corrected equations",
            )
    interface = settings.can.interface
    options = [
        f"--bus {settings.address}",
        f"--listen-s {settings.can.listen_s:g}",
        *_judging_words(settings),
        *_offered_words(settings.offered),
        *replace(settings.realtime, gc_freeze=True).words(),  # C collects no garbage
    ]
    return f"""\
{_unit(f"loaderhil ECU in C on {interface}", [interface])}
[Service]
Type=notify
User={USER}
# It listens before it sends, and ends with 1 where another ECU is on the bus. Its calibration is compiled in.
ExecStart={executable(program)} {" ".join(options)}
TimeoutStartSec={settings.can.listen_s + 10:g}
WatchdogSec={settings.watchdog_s:g}
Restart=always
RestartSec=0.2
# A wrong option does not mend itself.
RestartPreventExitStatus={int(Ending.MISUSED)}

{_rights(settings.realtime)}
# Sandbox. The interface is asked through the CAN socket itself, and nothing is compiled or written.
MemoryDenyWriteExecute=yes
{SANDBOX.replace("AF_CAN AF_NETLINK AF_UNIX AF_INET", "AF_CAN AF_UNIX")}{_install([interface])}"""


def _recorder(settings: ServiceSettings, recorder: RecorderSettings, program: str) -> str:
    interface = settings.can.interface
    # A recording never overwrites another one, so each start has a name of its own, which a shell makes.
    file = f"/var/log/loaderhil/{interface}-$(date -u +%Y%m%dT%H%M%SZ).{recorder.suffix}"
    command = (
        f"exec {shlex.quote(program)} record loader={settings.address} "
        f"--rotate-mib {recorder.rotate_mib:g} --out {file}"
    )
    return f"""\
{_unit(f"loaderhil recorder of {interface}", [interface])}
[Service]
Type=exec
User={USER}
ExecStart=/bin/sh -c {word(command)}
LogsDirectory=loaderhil
# It only listens: nothing on the bus depends on it, and a full disk may wait for somebody to make room.
Restart=always
RestartSec=20
RestartPreventExitStatus={int(Ending.MISUSED)}
SuccessExitStatus={int(Ending.INTERRUPTED)}
# Behind the ECU, where both want a processor or the disk.
Nice=10
IOSchedulingClass=idle

{CODE}
{_rights(RealtimeOptions())}
# Sandbox. It writes /var/log/loaderhil, and its cache.
{SANDBOX}{_install([interface])}"""


def _gateway(settings: ServiceSettings, gateway: GatewaySettings, program: str) -> str:
    both = [gateway.machine_interface, settings.can.interface]
    options = [
        f"--plant-bus socketcan:{gateway.machine_interface}",
        f"--ecu-bus {settings.address}",
        *([f"--routes {word(gateway.routes)}"] if gateway.routes else []),
        *settings.realtime.words(),
    ]
    return f"""\
{_unit(f"loaderhil gateway between {both[0]} and {both[1]}", both)}
[Service]
Type=exec
User={USER}
ExecStart={executable(program)} gateway {" ".join(options)}
# Without the gateway the machine hears no ECU, and falls back on safe limits by itself.
Restart=always
RestartSec=0.2
RestartPreventExitStatus={int(Ending.MISUSED)}
SuccessExitStatus={int(Ending.INTERRUPTED)}

{CODE}
{_rights(settings.realtime)}
# Sandbox.
{SANDBOX}{_install(both)}"""
