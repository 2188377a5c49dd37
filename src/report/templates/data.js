skylitReport.receive({{ key|tojson }}, {{ pixels|tojson }});
