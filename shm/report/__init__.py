"""Report on a bridge, a hanger, a hammer test or a gap diagnosis, as text, page, PDF and JSON.

Nothing here reads a store or writes a file. From a value of `contents` each kind of report makes a
`Paper` and a JSON document; `as_text`, `as_html` and `as_pdf` render any paper. `hanger_summary` is
what every output shows of a hanger, `hanger_status` the words of its state. Only this package
imports matplotlib, jinja2 and reportlab.
"""
