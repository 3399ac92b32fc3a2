(Pocket of the page's test: long enough to be looked at, deep enough for decisions)
G21 G17 G94 G90
M3 S6000
G0 X0 Y0 Z5
G1 Z-1 F300
X60 F600
Y10
X0
Y20
X60
Y30
X0
Y40
X60
G0 Z5
M30
