"""Components, the sources of FMUs: pure physics and control laws behind thin FMI classes.

Papers cited as A to D:

    A  Yuan, Chen, Huang, Shi, Adaptive lateral stability control of electric vehicle based on FNN
    B  Vehicle yaw stability control based on fuzzy sliding mode direct yaw moment
    C  Nie, Xiong, Pan, Multi-condition co-simulations of vehicle stability control via fuzzy PID algorithm,
       Journal of Dynamics and Control 19(3), 2021
    D  Xie, Li, Zheng, Pei, Synthesized feedback control of the ESP system based on fuzzy technology
"""
