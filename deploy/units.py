"""Files for systemd: the CAN interface, the ECU's service, its user. Text from settings; nothing is written here.

systemd.network(5), systemd.service(5), systemd.exec(5), sysusers.d(5).
"""

from collections.abc import Mapping

from deploy.settings import ServiceSettings
from hil.ending import Ending

USER = "loaderhil"
SETTINGS = "/etc/loaderhil/ecu.toml"
START_TIMEOUT_S = 180
"""A first start compiles the estimators: 20 to 40 s on a desktop processor, some times that on a small one."""


def service_files(
    settings: ServiceSettings, program: str, settings_file: str = SETTINGS
) -> Mapping[str, str]:
    """Path below the root of the target -> text.

    program: absolute path of the `loaderhil` command on the target; settings_file: absolute path there.
    """
    interface = settings.can.interface
    return {
        f"etc/systemd/network/70-loaderhil-{interface}.network": _network(settings),
        "etc/systemd/system/loaderhil-ecu.service": _service(settings, program, settings_file),
        "usr/lib/sysusers.d/loaderhil.conf": f'u {USER} - "loaderhil virtual ECU"\n',
    }


def _network(settings: ServiceSettings) -> str:
    can = settings.can
    return f"""\
# systemd-networkd sets the bit rate and brings {can.interface} up whenever it appears, also after an unplug.
[Match]
Name={can.interface}

[CAN]
BitRate={can.bit_rate}
RestartSec={can.restart_ms}ms
"""


def _service(settings: ServiceSettings, program: str, settings_file: str) -> str:
    interface = settings.can.interface
    realtime = settings.realtime
    # each capability only where an option needs it: what a service may do should follow from its settings
    needed = [
        *(["CAP_SYS_NICE"] if realtime.fifo is not None else []),
        *(["CAP_IPC_LOCK"] if realtime.lock_memory else []),
    ]
    capabilities = " ".join(needed)
    options = [
        f"--bus {settings.address}",
        f"--calibration {settings.calibration}",
        f"--form {settings.form}",
        *([] if settings.limits else ["--no-limits"]),
        *realtime.words(),
    ]
    return f"""\
[Unit]
Description=loaderhil virtual ECU on {interface}
# The interface is a device of the unit: an unplug stops the ECU, and the next plug starts it again.
BindsTo=sys-subsystem-net-devices-{interface}.device
After=sys-subsystem-net-devices-{interface}.device systemd-networkd.service
# A service that fails five times in a minute stays down: the machine is then on its own safe limits.
StartLimitIntervalSec=60
StartLimitBurst=5

[Service]
Type=notify
User={USER}
ExecStartPre={program} deploy check {settings_file}
ExecStart={program} ecu {" ".join(options)}
TimeoutStartSec={START_TIMEOUT_S}
WatchdogSec={settings.watchdog_s:g}
# Without the ECU the machine falls back on safe limits by itself, so that a quick restart costs comfort and not safety.
Restart=always
RestartSec=0.2
# Wrong settings do not mend themselves.
RestartPreventExitStatus={int(Ending.MISUSED)}
SuccessExitStatus={int(Ending.INTERRUPTED)}

# Compiled code is kept from one start to the next.
CacheDirectory=loaderhil
Environment=NUMBA_CACHE_DIR=/var/cache/loaderhil HOME=/var/cache/loaderhil

AmbientCapabilities={capabilities}
CapabilityBoundingSet={capabilities}
LimitMEMLOCK={"infinity" if realtime.lock_memory else "64K"}
LimitRTPRIO={realtime.fifo or 0}

# Sandbox. MemoryDenyWriteExecute stays off: the estimators are compiled when first used.
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

[Install]
WantedBy=multi-user.target sys-subsystem-net-devices-{interface}.device
"""
