"""The web interface: upload, status, alerts, health and metrics over HTTP (`[web]`).

`app` puts it together, one file a router; `access` says who may do what; `serving` begins it, on
its own or beside the daemon.
"""
