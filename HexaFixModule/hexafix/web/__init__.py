"""The browser workstation: ``hexafix serve``.

A door: it shows what the presenter holds and hands on what the user does. It computes nothing.
"""
