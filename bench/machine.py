"""What a time depends on besides the program."""

import os
import platform
import re

# Those that decide how many particles one instruction takes.
SIMD_FLAGS = ("sse2", "ssse3", "sse4_1", "sse4_2", "avx", "f16c", "fma", "avx2", "avx512f", "avx512dq", "avx512bw",
              "avx512vl", "asimd", "sve")


def read_text(path):
    try:
        with open(path, encoding="utf-8") as stream:
            return stream.read()
    except OSError:
        return ""


def describe_machine():
    cpu = read_text("/proc/cpuinfo")

    def field_of(text, name):
        found = re.search(rf"^{name}\s*[:=]\s*\"?([^\"\n]*)", text, re.M)
        return found.group(1).strip() if found else ""

    caches = []
    for index in range(8):
        directory = f"/sys/devices/system/cpu/cpu0/cache/index{index}/"
        level, kind, size = (read_text(directory + name).strip() for name in ("level", "type", "size"))
        if level and kind != "Instruction":
            caches.append(f"L{level} {size}")
    flags = set((field_of(cpu, "flags") or field_of(cpu, "Features")).split())
    memory_kib = float((field_of(read_text("/proc/meminfo"), "MemTotal") or "0 kB").split()[0])
    return {"cpu": field_of(cpu, "model name") or platform.machine(), "architecture": platform.machine(),
            "cores": len(os.sched_getaffinity(0)), "caches_of_one_core": caches,
            "simd": [flag for flag in SIMD_FLAGS if flag in flags], "memory_gib": round(memory_kib / 2**20, 1),
            "os": field_of(read_text("/etc/os-release"), "PRETTY_NAME"), "kernel": platform.release(),
            "load_at_start": round(os.getloadavg()[0], 2)}
