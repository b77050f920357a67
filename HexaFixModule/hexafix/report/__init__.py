"""Prescription PDF, pictures, tables: from a finished plan document.

`pdf.prescription_pdf` sets the PDF, `tables` writes CSV and markups, `picture.SceneRenderer`
renders the scene in a child process, and `printed.printed_rows` says what must be found in the
PDF's text. `format` is the one place where numbers become words.
"""
