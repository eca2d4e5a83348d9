"""Whether the images are of the right size and encoding, and the camera lives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.checks.finding import Found

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from garment_dataset.checks.contract import Contract, Stream, StreamRule
    from garment_dataset.checks.facts import Facts, ImageFacts, Sample


def check_images(facts: Facts, contract: Contract) -> Iterator[Found]:
    """Yield ``image-size``, ``image-encoding``, ``image-faulty``, ``dead``, ``dark`` and ``frozen``."""
    for stream, rule in contract.streams.items():
        if (images := facts.images.get(stream)) is not None:
            yield from _form(images, rule, facts)
            yield from _life(stream, images, contract, facts)
            yield from _frozen(images, rule.max_frozen_s, facts)


def _form(images: ImageFacts, rule: StreamRule, facts: Facts) -> Iterator[Found]:
    if rule.sizes_px and (odd_px := sorted(images.sizes_px - set(rule.sizes_px))):
        expected, found = (" or ".join(f"{w} x {h}" for w, h in sizes) for sizes in (rule.sizes_px, odd_px))
        yield Found("image-size", f"expected {expected} pixels, found {found}", images.topic)
    if rule.encodings and images.topic == rule.topic and (odd := sorted(images.encodings - set(rule.encodings))):
        yield Found("image-encoding", f"expected {' or '.join(rule.encodings)}, found {', '.join(odd)}", images.topic)
    if images.faulty is not None:
        count, first_ns, why = images.faulty
        text = f"{count} images cannot be used, the first: {why}"
        yield Found("image-faulty", text, images.topic, facts.time_s(first_ns))


def _life(stream: Stream, images: ImageFacts, contract: Contract, facts: Facts) -> Iterator[Found]:
    depth, color = contract.images.depth, contract.images.color
    if stream == "depth" and depth is not None:
        least, what = depth.least_valid, "pixels with a return"
        words = f"at most {100 * _most(images.samples):.1f} % of the {what}, expected {100 * least:g} %"
    elif color is not None:
        least, what = color.least_contrast, "grey levels of contrast"
        words = f"at most {_most(images.samples):.1f} {what}, expected {least:g}"
    dead = [sample for sample in images.samples if sample.alive < least]
    if dead and len(dead) == len(images.samples):
        hint = "Is the camera covered, unplugged, or without light?"
        yield Found("dead", f"nothing is to be seen: {words}", images.topic, hint=hint)
    elif dead:
        text = f"nothing is to be seen in {len(dead)} of {len(images.samples)} images that were looked at"
        yield Found("dark", text, images.topic, facts.time_s(dead[0].time_ns))


def _most(samples: Sequence[Sample]) -> float:
    return max((sample.alive for sample in samples), default=0.0)


def _frozen(images: ImageFacts, max_frozen_s: float, facts: Facts) -> Iterator[Found]:
    """Yield ``frozen`` for the longest time in which all images that were looked at are the same, pixel by pixel."""
    longest_ns, since = 0, images.samples[0] if images.samples else None
    begin_ns = 0
    for sample in images.samples:
        if since is None or sample.digest != since.digest:
            since = sample
        elif sample.time_ns - since.time_ns > longest_ns:
            longest_ns, begin_ns = sample.time_ns - since.time_ns, since.time_ns
    if longest_ns > max_frozen_s * 1e9:
        text = f"the same image, pixel by pixel, for {longest_ns / 1e9:.1f} s"
        yield Found("frozen", text, images.topic, facts.time_s(begin_ns), "The driver sent one image again and again.")
