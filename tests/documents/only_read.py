"""Commands of the pages that are not run, each with its reason. They are only read: their options and keys exist."""

IN_CI = "it is what CI itself runs"
SETS_UP = "it sets an environment up"
TIMES = "it measures for minutes"
NETWORK = "it downloads; tests/fetch runs it against servers on the local machine"
SERVES = "it is a server, which goes on until it is stopped"
SWEEP = "many jobs; tests/test_sweep.py runs sweeps, here every job's configuration is composed"
PAIRS = "it takes minutes: twelve pairs of sessions, and training for each"
PHOTOS = "it works for minutes to hours on photographs that are not part of the project"
LONG = "it works for minutes to hours on the campus, at its full size"
DRAWS = "it draws at full size, for a quarter of a minute, a picture that is there"
TRAINS = "it trains for minutes to hours"

_D = "../shared/data"
_CAMVID = f"{_D}/camvid_generic {_D}/camvid_changes"
_THREE = f"{_D}/camvid_changes {_D}/camvid_generic {_D}/stromovka_winter"
_COMPACT = f"--yolo {_D}/models/yolox_nano.onnx --bing {_D}/models/bing"
_MODELS = f"{_COMPACT}/ObjNessB2W8HSV"
_KEYS = f"obb.yolo.weights={_D}/models/yolox_nano.onnx obb.bing.filters={_D}/models/bing/ObjNessB2W8HSV"
_NETWORKS = f"obb.yolo.weights={_D}/models/yolox_nano.onnx obb.bing.filters={_D}/models/bing"
_FILTERS = f"--published {_D}/models/bing"
_OURS = "--looks fdslam/weights/yolo_campus.onnx"
_SWEPT = "ad.k=2,5,10 ad.c=0.4,0.8,1.6 evaluation.Y=1,3,10"
_CHANGES = f"dataset=folder dataset.root={_D}/camvid_changes"
_EXACT = f"{_CHANGES} bow.exact_below=1000000 {_KEYS}"

ONLY_READ = {
    IN_CI: ["make demo", "make test"],
    SETS_UP: ["pip install -c constraints.txt -e '.[export]'"],
    TIMES: [
        "make bench",
        "python -m experiments.speed.localization --json localization.json",
        "python -m experiments.speed.comparison",
        "python -m experiments.speed.query --threads 2 --memory 1000",
        f"python -m experiments.speed.compact {_D}/camvid_generic {_COMPACT} --times 4 16",
        "python -m experiments.speed.bing",
        f"python -m experiments.speed.update {_D}/camvid_generic {_COMPACT}",
        "python -m experiments.speed.growth --plot growth.png",
        "python -m experiments.speed.autoencoders",
        "python -m experiments.speed.autoencoders --channels 4 --pixels 3072",
        "python -m experiments.speed.recall",
    ],
    NETWORK: [
        "python -m fdslam.fetch yolox-nano",
        "python -m fdslam.fetch nclt --session WI --session SP --session SU --session AU --to DIR",
    ],
    SERVES: ["tensorboard --logdir outputs/tracking/tensorboard"],
    SWEEP: [
        "python -m fdslam.run -m +experiment=fd evaluation.Y=1,3,10",
        "python -m fdslam.run -m +experiment=fd_ad ad.k=2,5,10 ad.c=0.4,0.8 evaluation.Y=1,10",
        "python -m fdslam.run -m mix=fd,fd_ad,fd_ad_pc obb=j_b,j_b_bing_yolo hydra/launcher=joblib workers=1",
        f"python -m fdslam.run -m +experiment=fd_ad_pc {_SWEPT} report.pictures=0",
        'python -m fdslam.run -m "mix.rows=[AD]" learned=0,48,24 obb=j_b',
        f'python -m fdslam.run -m "mix.rows=[AD]" learned=0,82,41 obb=j_b {_CHANGES}',
        "python -m fdslam.run +experiment=obb_study",
        f"python -m fdslam.run +experiment=obb_study {_EXACT}",
        "python -m experiments.obb_study.libraries outputs/obb_study/*_sweep --plot libraries.png",
    ],
    PAIRS: [
        "python -m fdslam.run +experiment=table1",
        "python -m fdslam.run +experiment=table1 dataset=campus_full obb=j_b evaluation.curve_Y=[]",
        "python -m fdslam.run +experiment=table1 dataset=nclt dataset.root=DIR",
        "python -m experiments.campus.difficulty",
    ],
    PHOTOS: [
        f"python -m fdslam.run +experiment=table1 {_EXACT}",
        f"python -m experiments.table1.differences --root {_D}/camvid_changes --yolo {_D}/models/yolox_nano.onnx",
        f"python -m experiments.ablation.ablation {_THREE} {_MODELS}",
        f"python -m experiments.ablation.ablation {_THREE} {_MODELS} --part fusion --rows FD PC FD+PC",
        f"python -m experiments.ad.variants dataset=folder dataset.root={_D}/camvid_changes",
        f"python -m experiments.ad.places dataset=folder dataset.root={_D}/camvid_changes",
        f"python -m experiments.compact.table {_CAMVID} {_COMPACT} --learned 82",
        f"python -m experiments.compact.table {_CAMVID} {_COMPACT} --learned 41",
        f"python -m experiments.compact.table {_D}/stromovka_winter {_COMPACT} --learned 40",
        f"python -m experiments.compact.table {_CAMVID} {_COMPACT}",
        f"python -m experiments.compact.table {_CAMVID} {_D}/stromovka_winter {_COMPACT}",
        f"python -m experiments.compact.table {_CAMVID} {_D}/stromovka_winter {_COMPACT} {_OURS}",
        f"python -m experiments.compact.table {_CAMVID} {_D}/stromovka_winter {_COMPACT} --gradients",
        f"python -m experiments.compact.controls {_CAMVID} {_COMPACT}",
        f"python -m experiments.compact.movers {_CAMVID} {_COMPACT}",
        f"python -m experiments.compact.worst {_D}/camvid_generic {_COMPACT} --out outputs/worst",
        f"python -m experiments.obb_study.detection_rate {_THREE} {_FILTERS} --plot detection_rate.png",
        f"python -m experiments.refinement.effects {_THREE}",
        f"python -m experiments.speed.recall {_THREE}",
        f"python -m experiments.speed.report mode=best dataset=folder dataset.root={_D}/camvid_generic {_NETWORKS}",
    ],
    LONG: [
        "python -m experiments.ablation.ablation",
        "python -m experiments.ablation.ablation --part fusion --rows FD PC FD+PC",
        "python -m experiments.ad.variants dataset=campus",
        "python -m experiments.ad.places dataset=campus",
        "python -m experiments.compact.table",
        "python -m experiments.compact.table --gradients",
        "python -m experiments.compact.controls",
        "python -m experiments.compact.worst --out outputs/worst",
        "python -m experiments.refinement.effects",
        "python -m experiments.robustness.kill_and_resume --kills 10 +experiment=fd_ad_pc",
    ],
    DRAWS: ["python -m fdslam.data.campus.sheet docs/campus_seasons.jpg --places 2 8 14 31 42 88"],
    TRAINS: [
        "python -m experiments.train.bing",
        "python -m experiments.train.bing --out my.safetensors --space hsv dataset=folder dataset.root=DIR",
        "python -m experiments.train.deeplabv3plus",
        "python -m experiments.train.yolo",
        "python -m experiments.train.early_fusion",
        "python -m experiments.train.early_fusion --source gradients --worlds 2 --images 16",
    ],
}
