"""Texts as loggers write them: every quirk beside the plain numbers that it stands for."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np

ROWS, RATE = 400, 500.0
RNG = np.random.default_rng(11)
FORCE, ACC = RNG.normal(0, 2000, ROWS).round(3), RNG.normal(0, 3, ROWS).round(4)


def german(value: float, digits: int = 4) -> str:
    return f"{value:.{digits}f}".replace(".", ",")


def grouped(value: float) -> str:
    return f"{value:,.3f}".replace(",", " ").replace(".", ",").replace(" ", ".")


def rows(line: Callable[[int], str]) -> str:
    return "".join(f"{line(i)}\n" for i in range(ROWS))


def stamp(i: int, form: str = "%d.%m.%Y %H:%M:%S,%f") -> str:
    time = datetime(2026, 5, 1, 23, 59, 59, 700_000) + timedelta(seconds=i / RATE)
    return time.strftime(form)[:-3]


PLAIN = rows(lambda i: f"{i / RATE:.3f},{FORCE[i]:.3f},{ACC[i]:.4f}")
SHAPES: dict[str, str | bytes] = {
    "german": (
        "catman\nMessung;quer\nAbtastrate;500 Hz\n\nZeit [s];Kraft [N];Beschl. [m/s²]\n"
        + rows(lambda i: f"{german(i / RATE)};{german(FORCE[i])};{german(ACC[i])}")
    ).encode("latin-1"),
    "two rows": "Time,Force,Acc\ns,N,m/s2\n" + PLAIN,
    "two rows and a group": ",Hammer,Sensor 1\nTime,Force,Acc\n(s),(N),(m/s²)\n" + PLAIN,
    "preamble": ("Recorder\nSample rate: 500 Hz\n\nTime (s),Force (N),Acc (m/s^2)\n" + PLAIN),
    "utf-16": ("Time (s),Force (N),Acc (m/s²)\n" + PLAIN).encode("utf-16"),
    "utf-16 unmarked": ("Time (s),Force (N),Acc (m/s2)\n" + PLAIN).encode("utf-16-le"),
    "quotes": '"Time (s)","Force, top (N)","Acc (m/s2)"\n' + PLAIN,
    "quoted german": '"Zeit [s]","Kraft [N]","Beschl [m/s2]"\n'
    + rows(lambda i: f'"{german(i / RATE)}","{german(FORCE[i])}","{german(ACC[i])}"'),
    "grouped thousands": "Zeit (ms);Kraft (N);Acc (m/s2)\n"
    + rows(lambda i: f"{2 * i};{grouped(FORCE[i])};{german(ACC[i])}"),
    "clock times over midnight": "Zeitstempel;Kraft [N];a_z [m/s²]\n"
    + rows(lambda i: f"{stamp(i)};{german(FORCE[i])};{german(ACC[i])}"),
    "clock alone over midnight": "Uhrzeit;Kraft [N];a_z [m/s²]\n"
    + rows(lambda i: f"{stamp(i, '%H:%M:%S.%f')};{german(FORCE[i])};{german(ACC[i])}"),
    "day and clock": "Date,Time,Force [N],Acc [m/s2]\n"
    + rows(lambda i: f"{stamp(i, '%Y-%m-%d,%H:%M:%S.%f')},{FORCE[i]:.3f},{ACC[i]:.4f}"),
    "clock to the second": "Time,Force [N],Acc [m/s2]\nSample rate: 500 Hz\n".replace(
        "Time", "Sample rate: 500 Hz\nTime", 1
    ).rsplit("Sample", 1)[0]
    + rows(lambda i: f"10:00:{(i + 321) // 500:02d},{FORCE[i]:.3f},{ACC[i]:.4f}"),
    "epoch in ms": "timestamp;force_N;acc_ms-2\n"
    + rows(lambda i: f"{1777629600000 + 2 * i};{FORCE[i]:.3f};{ACC[i]:.4f}"),
    "no times": "Abtastintervall: 2 ms\nKraft [N]\tBeschl [m/s²]\n"
    + rows(lambda i: f"{german(FORCE[i])}\t{german(ACC[i])}"),
    "counter": "Samplerate;500;Hz\nNr;Kraft (N);Beschl (m/s²)\n"
    + rows(lambda i: f"{i + 1};{german(FORCE[i])};{german(ACC[i])}"),
    "labelled rows": "Kanal;Zeit;Kraft;Beschl\nEinheit;s;N;m/s²\nFilter;-;200 Hz;200 Hz\n"
    + rows(lambda i: f";{german(i / RATE)};{german(FORCE[i])};{german(ACC[i])}"),
    "LabVIEW": "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n"
    "Date\t2026/05/01\n***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t400\t400\t\n"
    "Y_Unit_Label\tNewtons\tm/s^2\t\nDelta_X\t0.002000\t0.002000\t\n***End_of_Header***\t\t\t\n"
    "X_Value\tForce\tUntitled\tComment\n"
    + rows(lambda i: f"{i / RATE:.6f}\t{FORCE[i]:.3f}\t{ACC[i]:.4f}"),
    "blanks": "   Time [s]     Force [N]   Acc [m/s2]\n"
    + rows(lambda i: f"  {i / RATE:.3f}   {FORCE[i]:.3f}  {ACC[i]:.4f}"),
    "tail": "Time (s),Force (N),Acc (m/s2)\n" + PLAIN + "\nMin,-1,-2\nMax,1,2\n",
    "trailing marks": "Zeit [s];Kraft [N];Beschl [m/s2];\n"
    + rows(lambda i: f"{german(i / RATE)};{german(FORCE[i])};{german(ACC[i])};"),
    "other sensors": "Time (s),Force (N),Temp (°C),State,Acc (m/s2)\n"
    + rows(lambda i: f"{i / RATE:.3f},{FORCE[i]:.3f},12.5,OK,{ACC[i]:.4f}"),
    "lost sign of a square": "Time (s),Force (N),Acc (m/sÂ²)\n" + PLAIN,
}  # fmt: skip
