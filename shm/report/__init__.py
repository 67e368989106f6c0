"""Reports of a hanger, sheets of one hammer test, gap diagnoses, scores of a blind trial.

Nothing here reads a store or writes a file: `HangerReport`, `TestSheet` (by which a person checks a
test), `BridgeReport`, `DiagnosisSheet` or `TrialScore` in, terminal text, one HTML file, PDF bytes,
a JSON document or figures out. Only this room opens matplotlib, jinja2 and reportlab.
"""
