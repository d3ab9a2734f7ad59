"""One thread a test, as in a run's workers, and examples without a clock: the machine may be shared."""

from hypothesis import settings

from fdslam.progress import single_threaded

settings.register_profile("fdslam", deadline=None, max_examples=60)
settings.load_profile("fdslam")
single_threaded()
