"""Reads a log with Python's mcap package, holds each message against its schema, and prints how many there are of each topic."""
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
            # What is not named there has no place in a message.
            validators[schema.id] = jsonschema.Draft202012Validator({**shape, "additionalProperties": False})
        validators[schema.id].validate(json.loads(message.data))
        count[channel.topic] += 1
for topic, messages in sorted(count.items()):
    print(topic, messages)
