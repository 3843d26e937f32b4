"""Reads a log with Python's mcap package, validates each message, and prints the count of each topic."""
import collections
import json
import sys

import jsonschema
from mcap.reader import make_reader

validators, count = {}, collections.Counter()
with open(sys.argv[1], "rb") as file:
    for schema, channel, message in make_reader(file).iter_messages():
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        if schema.id not in validators:
            shape = json.loads(schema.data)
            # Messages must not contain fields that the schema does not name.
            validators[schema.id] = jsonschema.Draft202012Validator({**shape, "additionalProperties": False})
        validators[schema.id].validate(json.loads(message.data))
        count[channel.topic] += 1
for topic, messages in sorted(count.items()):
    print(topic, messages)
