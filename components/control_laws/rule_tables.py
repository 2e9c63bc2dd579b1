"""Fuzzy rule tables of papers C and D, in the format of `mathematics.fuzzy`.

Rows are the error, columns its rate, both from NB to PB.
"""

STANDARD = """
    NB NB NB NS Z
    NB NB NS Z  PS
    NB NS Z  PS PB
    NS Z  PS PB PB
    Z  PS PB PB PB
"""
"""Standard monotone table of five sets; replaces paper D's tables 1 and 2, which were lost."""

GENTLE = """
    NB NB NS NS Z
    NB NS NS Z  PS
    NS NS Z  PS PS
    NS Z  PS PS PB
    Z  PS PS PB PB
"""
"""Published table of five sets, flatter near zero: World Electric Vehicle Journal 13(7), 2022, 109."""

FIVE_BY_FIVE = {"standard": STANDARD, "gentle": GENTLE}
"""Name of a table of five sets -> the table."""

PID_GAINS = """
    PB/NB/PS  PB/NB/NS  PM/NM/PB  PM/NM/NB  PS/NS/NB  ZO/ZO/NM  ZO/ZO/PS
    PB/NB/PS  PB/NB/NS  PM/NM/PB  PS/NS/NM  PS/NS/NM  ZO/ZO/NS  NS/ZO/ZO
    PM/NB/ZO  PM/NM/NS  PM/NS/NM  PS/NS/NM  ZO/ZO/NS  NS/PS/NS  NS/PS/ZO
    PM/NM/ZO  PM/NM/NS  PS/NS/NS  ZO/ZO/NS  NS/PS/NS  NS/PM/NS  NM/PM/ZO
    PS/NM/ZO  PS/NS/ZO  ZO/ZO/ZO  NS/PS/ZO  NS/PM/ZO  NM/PM/ZO  NM/PM/ZO
    PS/ZO/PM  ZO/ZO/PS  NS/PS/PS  NS/PS/PS  NM/PM/PS  NM/PB/PS  NB/PB/PM
    ZO/ZO/PB  ZO/PS/PM  NM/PS/PM  NM/PM/PS  NM/PM/PS  NB/PB/PS  NB/PB/PB
"""
"""dK_p/dK_i/dK_d; paper C, table 2. Its dK_d at e = NB, NM and de = NS, PB is NB in the common table."""
