"""MCAP files with ROS 2 messages that lack the `metadata.yaml` of a bag: the file alone says enough."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mecanum_env.errors import InputError, install_command


def read_lone_mcap(
    path: Path, choose: Callable[[Mapping[str, str]], set[str]]
) -> tuple[dict[str, str], dict[str, list[tuple[int, Any]]]]:
    """Return the type of every topic, and time of receipt [ns] and message of those that `choose` returns.

    `path` is that of the file.

    Raises:
        InputError: `mcap` is not installed.
    """
    try:
        from mcap.reader import make_reader
    except ImportError as error:
        raise InputError(
            f"{path}: an MCAP file without the metadata.yaml of a bag needs mcap: {install_command('mcap')}"
        ) from error
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.LATEST)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        found = reader.get_summary()
        if found is None:
            raise ValueError("no summary: the recording was cut off; `mcap recover` writes one")
        types: dict[str, str] = {}
        for channel in found.channels.values():
            schema = found.schemas.get(channel.schema_id)
            if channel.message_encoding != "cdr" or schema is None or schema.encoding != "ros2msg":
                continue
            types[channel.topic] = schema.name
            stated = get_types_from_msg(schema.data.decode(), schema.name)
            store.register({name: one for name, one in stated.items() if name not in store.fielddefs})
        wanted = choose(types)
        messages: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in wanted}
        for _, channel, message in reader.iter_messages(topics=sorted(wanted)):
            value = store.deserialize_cdr(message.data, types[channel.topic])
            messages[channel.topic].append((message.log_time, value))
    return types, messages
