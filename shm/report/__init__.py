"""Reports of a hanger, sheets of one hammer test, gap diagnoses.

Nothing here reads a store or writes a file. Of a noun of `contents` a kind of report makes a
`Paper` and a JSON document; `as_text`, `as_html` and `as_pdf` render any paper. Only this room
opens matplotlib, jinja2 and reportlab.
"""
